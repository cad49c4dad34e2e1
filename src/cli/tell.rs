//! Standard output, whose reader may leave before all is said: `neubrdf material X | head`.

use std::fmt;
use std::io::{ErrorKind, Write, stdout};

use anyhow::{Context, Result};

/// Writes a line to standard output. That nobody reads any longer is no error; a full disk is.
pub fn line(words: fmt::Arguments) -> Result<()> {
    match writeln!(stdout(), "{words}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error).context("standard output"),
        _ => Ok(()),
    }
}

/// `eprintln!` to whoever still listens: whose terminal is gone has other worries than our end.
macro_rules! note {
    ($($words:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), $($words)*);
    }};
}

/// `println!` by [`line`]; its value is a `Result`.
macro_rules! tell {
    ($($words:tt)*) => { $crate::cli::tell::line(format_args!($($words)*)) };
}
