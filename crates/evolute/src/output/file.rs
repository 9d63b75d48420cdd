//! Files that appear whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::OutputError;

/// Names tried beside the target before giving up. One is enough unless runs that were killed left
/// theirs behind, or runs at the same time write to the same target.
const NAMES: u32 = 1000;

/// Puts `bytes` at `path`: they are written beside it and renamed into place, so that a reader sees
/// the old file or the new one. A symbolic link keeps pointing where it does; a device or a pipe is
/// written to directly.
///
/// # Errors
/// [`OutputError::File`]; what was at `path` is as before, and nothing is left beside it.
pub fn replace_file(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let error = |source| OutputError::File { path: path.into(), source };
    let target = resolve(path);
    match fs::metadata(&target) {
        Ok(m) if m.is_dir() => Err(error(io::Error::other("it is a folder"))),
        Ok(m) if !m.is_file() => {
            { File::options().write(true).open(&target).and_then(|mut f| f.write_all(bytes)) }
                .map_err(error)
        }
        existing => {
            let (mut file, staged) = Staged::beside(&target).map_err(error)?;
            let write = || -> io::Result<()> {
                if let Ok(m) = existing {
                    file.set_permissions(m.permissions())?;
                }
                file.write_all(bytes)?;
                file.sync_all()?;
                drop(file);
                staged.rename_to(&target)
            };
            write().map_err(error)
        }
    }
}

/// Whether [`replace_file`] could write there, to be asked before long work. Leaves no trace.
///
/// # Errors
/// [`OutputError::File`] if the folder does not exist or may not be written to, or `path` is a folder.
pub fn check_target(path: &Path) -> Result<(), OutputError> {
    let error = |source| OutputError::File { path: path.into(), source };
    let target = resolve(path);
    match fs::metadata(&target) {
        Ok(m) if m.is_dir() => Err(error(io::Error::other("it is a folder"))),
        Ok(m) if !m.is_file() => Ok(()),
        _ => Staged::beside(&target).map(drop).map_err(error),
    }
}

/// Where a chain of symbolic links leads, if it leads anywhere.
fn resolve(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| path.into())
}

/// A file beside its target, removed when dropped unless renamed.
struct Staged(Option<PathBuf>);

impl Staged {
    fn beside(target: &Path) -> io::Result<(File, Self)> {
        let name = target.file_name().ok_or_else(|| io::Error::other("it names no file"))?;
        let folder = match target.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        };
        if !folder.is_dir() {
            return Err(io::Error::new(
                io::ErrorKind::NotFound,
                format!("there is no folder '{}'", folder.display()),
            ));
        }
        for i in 0..NAMES {
            let mut staged = std::ffi::OsString::from(".");
            staged.push(name);
            staged.push(format!(".{}-{i}.part", std::process::id()));
            let staged = folder.join(staged);
            match OpenOptions::new().write(true).create_new(true).open(&staged) {
                Ok(file) => return Ok((file, Self(Some(staged)))),
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(e),
            }
        }
        Err(io::Error::other("no name for a temporary file is free beside it"))
    }

    fn rename_to(mut self, target: &Path) -> io::Result<()> {
        if let Some(staged) = &self.0 {
            fs::rename(staged, target)?;
        }
        self.0 = None;
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if let Some(staged) = &self.0 {
            // Nothing more can be done about a file that cannot be removed.
            let _ = fs::remove_file(staged);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A folder that goes with the test.
    struct Folder(PathBuf);

    impl std::ops::Deref for Folder {
        type Target = Path;
        fn deref(&self) -> &Path {
            &self.0
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn folder(name: &str) -> Folder {
        let f = std::env::temp_dir().join(format!("evolute-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&f);
        fs::create_dir_all(&f).unwrap();
        Folder(f)
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut n: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        n.sort();
        n
    }

    #[test]
    fn replaces_and_leaves_nothing_beside() {
        let f = folder("replaces");
        let target = f.join("a.csv");
        replace_file(&target, b"one").unwrap();
        replace_file(&target, b"two").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"two");
        assert_eq!(names(&f), ["a.csv"]);
    }

    #[test]
    fn a_failed_rename_removes_what_was_staged() {
        let f = folder("fails");
        fs::create_dir(f.join("a.csv")).unwrap();
        // A folder in the way is found before anything is written …
        assert!(replace_file(&f.join("a.csv"), b"x").unwrap_err().to_string().contains("folder"));
        // … and one that appears afterwards makes the rename fail.
        let (_, staged) = Staged::beside(&f.join("a.csv")).unwrap();
        assert_eq!(names(&f).len(), 2);
        assert!(staged.rename_to(&f.join("a.csv")).is_err());
        assert_eq!(names(&f), ["a.csv"]);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let f = folder("missing");
        let path = f.join("no/such/a.csv");
        for error in [replace_file(&path, b"x").unwrap_err(), check_target(&path).unwrap_err()] {
            assert!(error.to_string().contains("no/such"), "{error}");
        }
    }

    #[test]
    fn checking_leaves_no_trace() {
        let f = folder("checks");
        check_target(&f.join("a.csv")).unwrap();
        assert!(names(&f).is_empty());
        fs::write(f.join("a.csv"), b"old").unwrap();
        check_target(&f.join("a.csv")).unwrap();
        assert_eq!(fs::read(f.join("a.csv")).unwrap(), b"old");
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_permissions_kept() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let f = folder("links");
        fs::write(f.join("real"), b"old").unwrap();
        fs::set_permissions(f.join("real"), fs::Permissions::from_mode(0o640)).unwrap();
        symlink(f.join("real"), f.join("link")).unwrap();
        replace_file(&f.join("link"), b"new").unwrap();
        assert_eq!(fs::read(f.join("real")).unwrap(), b"new");
        assert!(fs::symlink_metadata(f.join("link")).unwrap().is_symlink());
        assert_eq!(fs::metadata(f.join("real")).unwrap().permissions().mode() & 0o777, 0o640);
        replace_file(Path::new("/dev/null"), b"gone").unwrap();
    }
}
