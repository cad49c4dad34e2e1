//! Files that are there whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
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
    let path = path.as_ref();
    let io_error = |source| E::from(Error::Io { path: path.to_owned(), source });
    let partial = partial(path).map_err(io_error)?;
    let finish = || {
        let mut writer = BufWriter::new(create(&partial).map_err(io_error)?);
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

/// The same of bytes that are there already.
///
/// # Errors
/// The operating system says no, or `path` is there and no regular file.
pub fn write_file(path: impl AsRef<Path>, bytes: impl AsRef<[u8]>) -> Result<(), Error> {
    let path = path.as_ref();
    atomic_write(path, |file| {
        file.write_all(bytes.as_ref()).map_err(|source| Error::Io { path: path.to_owned(), source })
    })
}

/// Whether [`atomic_write`] could begin: a file is made beside `path` and taken away again.
///
/// # Errors
/// The operating system says no, or `path` is there and no regular file.
pub fn check_writable(path: impl AsRef<Path>) -> Result<(), Error> {
    let path = path.as_ref();
    let probe = || {
        let partial = partial(path)?;
        create(&partial)?;
        fs::remove_file(&partial)
    };
    probe().map_err(|source| Error::Io { path: path.to_owned(), source })
}

/// The name of a file beside `path` that becomes it.
fn partial(path: &Path) -> io::Result<PathBuf> {
    static UNIQUE: AtomicU32 = AtomicU32::new(0);
    if fs::metadata(path).is_ok_and(|metadata| !metadata.is_file()) {
        return Err(io::Error::other("is not a regular file; name a file to write to"));
    }
    let name = path.file_name().ok_or_else(|| io::Error::other("names no file"))?.to_string_lossy();
    let unique = UNIQUE.fetch_add(1, Ordering::Relaxed);
    Ok(path.with_file_name(format!(".{name}.{}-{unique}.partial", std::process::id())))
}

fn create(partial: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).open(partial).map_err(|error| match partial.parent() {
        Some(parent) if error.kind() == io::ErrorKind::NotFound => {
            // Of a directory that takes no files, such as /proc, Linux says the same.
            let is_there = parent.join(".").is_dir();
            let what = if is_there { "no file can be made in" } else { "there is no directory" };
            io::Error::new(error.kind(), format!("{what} {}", parent.display()))
        }
        _ => error,
    })
}
