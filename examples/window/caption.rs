//! Words over a picture: letters of 5 by 7 dots, as bytes to copy into it.

/// Letters in a line, and lines. More are cut off.
const TEXT: [usize; 2] = [14, 3];
/// Dots from letter to letter, and from line to line.
const CELL: [usize; 2] = [6, 9];
/// Pixels of a dot, a side.
const DOT: usize = 2;
/// Pixels across and down.
pub const SIZE: [usize; 2] = [TEXT[0] * CELL[0] * DOT, TEXT[1] * CELL[1] * DOT];

const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255; 4];

/// The text, white on black, in four bytes a pixel, red or blue first.
pub fn draw(text: &str) -> Vec<u8> {
    let mut pixels = BLACK.repeat(SIZE[0] * SIZE[1]);
    for (row, line) in text.lines().take(TEXT[1]).enumerate() {
        for (column, letter) in line.chars().take(TEXT[0]).enumerate() {
            for (x, y) in dots(letter) {
                let [left, top] = [(column * CELL[0] + x) * DOT, (row * CELL[1] + y) * DOT];
                for pixel in (top..top + DOT).flat_map(|y| (left..left + DOT).map(move |x| y * SIZE[0] + x)) {
                    pixels[4 * pixel..4 * pixel + 4].copy_from_slice(&WHITE);
                }
            }
        }
    }
    pixels
}

/// The places of a letter's dots, a dot away from the upper and the left end of its cell.
fn dots(letter: char) -> impl Iterator<Item = (usize, usize)> {
    let rows: [&str; 7] = match letter {
        '0' => [" ### ", "#   #", "#  ##", "# # #", "##  #", "#   #", " ### "],
        '1' => ["  #  ", " ##  ", "  #  ", "  #  ", "  #  ", "  #  ", " ### "],
        '2' => [" ### ", "#   #", "    #", "  ## ", " #   ", "#    ", "#####"],
        '3' => [" ### ", "#   #", "    #", "  ## ", "    #", "#   #", " ### "],
        '4' => ["   # ", "  ## ", " # # ", "#  # ", "#####", "   # ", "   # "],
        '5' => ["#####", "#    ", "#### ", "    #", "    #", "#   #", " ### "],
        '6' => ["  ## ", " #   ", "#    ", "#### ", "#   #", "#   #", " ### "],
        '7' => ["#####", "    #", "   # ", "  #  ", "  #  ", "  #  ", "  #  "],
        '8' => [" ### ", "#   #", "#   #", " ### ", "#   #", "#   #", " ### "],
        '9' => [" ### ", "#   #", "#   #", " ####", "    #", "   # ", " ##  "],
        '.' => ["     ", "     ", "     ", "     ", "     ", " ##  ", " ##  "],
        '%' => ["##   ", "##  #", "   # ", "  #  ", " #   ", "#  ##", "   ##"],
        'e' => ["     ", "     ", " ### ", "#   #", "#####", "#    ", " ### "],
        'o' => ["     ", "     ", " ### ", "#   #", "#   #", "#   #", " ### "],
        'p' => ["     ", "     ", "#### ", "#   #", "#### ", "#    ", "#    "],
        'r' => ["     ", "     ", "# ## ", "##   ", "#    ", "#    ", "#    "],
        's' => ["     ", "     ", " ####", "#    ", " ### ", "    #", "#### "],
        _ => [""; 7],
    };
    let row = |(y, row): (usize, &'static str)| row.match_indices('#').map(move |(x, _)| (x + 1, y + 1));
    rows.into_iter().enumerate().flat_map(row)
}
