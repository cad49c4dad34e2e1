//! Files that are there whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::Error;

/// As many links as Linux follows.
const MOST_LINKS: usize = 40;

/// Writes a file beside `path`, flushes it to the disk and renames it to `path`; on any error the target is untouched. A link stays one:
/// what it leads to is written.
///
/// `write` may fail with any error that an [`Error`] can become. Refuses a target that is there and is no regular
/// file, or may not be written: a rename would replace a device, a directory, or what somebody protected.
pub fn atomic_write<E: From<Error>>(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    let path = path.as_ref();
    let io_error = |source| E::from(Error::Io { path: path.to_owned(), source });
    let target = target(path).map_err(io_error)?;
    let partial = partial(&target).map_err(io_error)?;
    let finish = || {
        let mut writer = BufWriter::new(create(&partial).map_err(io_error)?);
        write(&mut writer)?;
        writer.flush().map_err(io_error)?;
        writer.get_ref().sync_all().map_err(io_error)?;
        fs::rename(&partial, &target).map_err(io_error)
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
/// The operating system says no, or `path` is there and no regular file that may be written.
pub fn write_file(path: impl AsRef<Path>, bytes: impl AsRef<[u8]>) -> Result<(), Error> {
    let path = path.as_ref();
    atomic_write(path, |file| {
        file.write_all(bytes.as_ref()).map_err(|source| Error::Io { path: path.to_owned(), source })
    })
}

/// Whether [`atomic_write`] could begin: a file is made beside `path` and taken away again. Returns where it would write, links followed.
///
/// # Errors
/// The operating system says no, or `path` is there and no regular file that may be written.
pub fn check_writable(path: impl AsRef<Path>) -> Result<PathBuf, Error> {
    let path = path.as_ref();
    let probe = || {
        let target = target(path)?;
        let partial = partial(&target)?;
        create(&partial)?;
        fs::remove_file(&partial)?;
        Ok(target)
    };
    probe().map_err(|source| Error::Io { path: path.to_owned(), source })
}

/// Where `path` leads, whether a file is there or not, unless what is there is not to be replaced.
fn target(path: &Path) -> io::Result<PathBuf> {
    let mut target = path.to_owned();
    let mut links = 0;
    while fs::symlink_metadata(&target).is_ok_and(|metadata| metadata.is_symlink()) {
        links += 1;
        if links > MOST_LINKS {
            return Err(io::Error::other("is a link that leads to no end"));
        }
        target = target.with_file_name(fs::read_link(&target)?);
    }
    if let Ok(metadata) = fs::metadata(&target) {
        if !metadata.is_file() {
            return Err(io::Error::other("is not a regular file; name a file to write to"));
        }
        // A rename asks the directory alone; and whoever may write everything should not by mistake.
        if metadata.permissions().readonly() {
            return Err(io::Error::new(
                io::ErrorKind::PermissionDenied,
                "is read-only; name another file, or allow writing",
            ));
        }
        OpenOptions::new().write(true).open(&target)?;
    }
    Ok(target)
}

/// The name of a file beside `target` that becomes it.
fn partial(target: &Path) -> io::Result<PathBuf> {
    static UNIQUE: AtomicU32 = AtomicU32::new(0);
    let name = target.file_name().ok_or_else(|| io::Error::other("names no file"))?.to_string_lossy();
    let unique = UNIQUE.fetch_add(1, Ordering::Relaxed);
    Ok(target.with_file_name(format!(".{name}.{}-{unique}.partial", std::process::id())))
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
