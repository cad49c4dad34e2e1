//! Files that are there whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

use super::Error;

/// Writes a file beside `path`, flushes it to the disk and renames it to `path`; on any error the target is untouched.
///
/// `write` may fail with any error that an [`Error`] can become. Refuses a target that is there and is no regular
/// file: a rename would replace a device or a directory.
pub fn atomic_write<E: From<Error>>(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    static UNIQUE: AtomicU32 = AtomicU32::new(0);
    let path = path.as_ref();
    let io_error = |source| E::from(Error::Io { path: path.to_owned(), source });

    if fs::metadata(path).is_ok_and(|metadata| !metadata.is_file()) {
        return Err(io_error(io::Error::other("is not a regular file; name a file to write to")));
    }
    let name = path.file_name().ok_or_else(|| io_error(io::Error::other("names no file")))?;
    let unique = UNIQUE.fetch_add(1, Ordering::Relaxed);
    let partial = path.with_file_name(format!(".{}.{}-{unique}.partial", name.to_string_lossy(), std::process::id()));

    let finish = || {
        let file = OpenOptions::new().write(true).create_new(true).open(&partial).map_err(io_error)?;
        let mut writer = BufWriter::new(file);
        write(&mut writer)?;
        writer.flush().map_err(io_error)?;
        writer.get_ref().sync_all().map_err(io_error)?;
        fs::rename(&partial, path).map_err(io_error)
    };
    let result = finish();
    if result.is_err() {
        // It may never have been created; the first error is the one worth telling.
        let _ = fs::remove_file(&partial);
    }
    result
}
