//! OBJ and MTL are lines of statements. `tobj` parses them, but it tells neither the line nor the file of an error,
//! trusts indices, and panics on a colour of two numbers. So every statement passes a check first, which may also
//! rewrite it into what `tobj` understands.

use std::io::{self, BufRead, Read};
use std::path::Path;

use super::error::{BYTE_ORDER_MARK, Error, Place, quote};

/// Longest statement, bytes: a polygon of a million corners.
const LONGEST: usize = 32 << 20;

/// What is wrong with a statement.
pub(super) struct Fault {
    pub found: String,
    pub expected: String,
}

impl Fault {
    pub fn new(found: impl Into<String>, expected: impl Into<String>) -> Fault {
        Fault { found: found.into(), expected: expected.into() }
    }

    /// The same fault, saying in what.
    pub fn of(self, what: String) -> Fault {
        Fault { found: format!("{} in {what}", self.found), ..self }
    }
}

/// A reader of the statements that `check` appends to its second argument, a whole number of lines at a time.
pub(super) struct Statements<'a, R, F> {
    file: &'a Path,
    /// What names the file, unless the user did.
    needed_by: Option<&'a Place>,
    reader: R,
    check: F,
    /// Last line that was read, from 1.
    line: usize,
    raw: Vec<u8>,
    checked: String,
    given: usize,
    error: Option<Error>,
}

impl<'a, R: BufRead, F: FnMut(usize, &str, &mut String) -> Result<(), Fault>> Statements<'a, R, F> {
    pub fn new(file: &'a Path, needed_by: Option<&'a Place>, reader: R, check: F) -> Self {
        Statements {
            file,
            needed_by,
            reader,
            check,
            line: 0,
            raw: Vec::new(),
            checked: String::new(),
            given: 0,
            error: None,
        }
    }

    /// The error that stopped the reading, or else `otherwise` at the last line that was read.
    pub fn into_error(self, otherwise: tobj::LoadError) -> Error {
        let place = Place::line(self.file, self.line);
        self.error.unwrap_or_else(|| Error::unexpected(place, otherwise.to_string(), "a statement that tobj can parse"))
    }

    /// Reads the next statement, joining lines that end in a backslash. Returns false at the end of the file.
    fn advance(&mut self) -> Result<bool, Error> {
        self.raw.clear();
        loop {
            let start = self.raw.len();
            let room = (LONGEST - start) as u64;
            let read = (&mut self.reader).take(room).read_until(b'\n', &mut self.raw);
            let read = read.map_err(|source| Error::read(self.file, self.needed_by, source))?;
            if self.raw.len() >= LONGEST {
                let found = format!("a statement longer than {} MiB", LONGEST >> 20);
                return Err(Error::unexpected(Place::line(self.file, self.line + 1), found, "a shorter one"));
            }
            if read == 0 {
                match start {
                    0 => return Ok(false),
                    _ => break,
                }
            }
            self.line += 1;
            if self.line == 1 && self.raw.starts_with(BYTE_ORDER_MARK) {
                self.raw.drain(..BYTE_ORDER_MARK.len());
            }
            let end = self.raw.trim_ascii_end().len();
            // Such a file is one line, which often is a comment.
            if self.line == 1 && self.raw[..end].contains(&b'\r') {
                let found = "lines that end in CR alone, as on early Macintoshes";
                return Err(Error::unexpected(Place::line(self.file, 1), found, "lines that end in LF or CR LF"));
            }
            self.raw.truncate(end.max(start));
            let comment = self.raw.trim_ascii_start().first() == Some(&b'#');
            match self.raw.last_mut() {
                Some(last @ b'\\') if !comment => *last = b' ',
                _ => break,
            }
        }
        self.checked.clear();
        self.given = 0;
        let text = String::from_utf8_lossy(&self.raw);
        let statement = text.trim();
        if !statement.is_empty() && !statement.starts_with('#') {
            (self.check)(self.line, statement, &mut self.checked).map_err(|Fault { found, expected }| {
                let mut place = Place::line(self.file, self.line);
                place.field = statement.split_whitespace().next().map(quote);
                Error::unexpected(place, found, expected)
            })?;
        }
        Ok(true)
    }
}

impl<R: BufRead, F: FnMut(usize, &str, &mut String) -> Result<(), Fault>> Read for Statements<'_, R, F> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl<R: BufRead, F: FnMut(usize, &str, &mut String) -> Result<(), Fault>> BufRead for Statements<'_, R, F> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        while self.given == self.checked.len() {
            match self.advance() {
                Ok(true) => {}
                Ok(false) => return Ok(&[]),
                Err(error) => {
                    self.error = Some(error);
                    return Err(io::Error::other("see Statements::into_error"));
                }
            }
        }
        Ok(&self.checked.as_bytes()[self.given..])
    }

    fn consume(&mut self, count: usize) {
        self.given += count;
    }
}

/// The next word as a finite number.
pub(super) fn number<'a>(words: &mut impl Iterator<Item = &'a str>) -> Result<f32, Fault> {
    let word = words.next().ok_or_else(|| Fault::new("the end of the statement", "a number"))?;
    match word.parse::<f32>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(Fault::new(quote(word), "a finite number")),
    }
}
