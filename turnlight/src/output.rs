//! Output that appears whole or not at all: written beside its place, flushed, then renamed.

use crate::Error;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::{Builder, TempDir, TempPath};

/// Writes `bytes` to `path`, whole or not at all.
///
/// # Errors
/// Names the file and what the system said; nothing is left behind.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let is_device = fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir());
    let write = || -> std::io::Result<()> {
        // A pipe or a device is written to, never replaced.
        if is_device {
            return fs::OpenOptions::new().write(true).open(path)?.write_all(bytes);
        }
        let mut file = Builder::new().prefix(".turnlight-").tempfile_in(parent(path))?;
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        make_readable(file.path(), 0o666)?;
        file.persist(path)?;
        Ok(())
    };
    write().map_err(|source| cannot_write(path, source))
}

/// Refuses a place where no file can be written, before any work is done for one.
///
/// # Errors
/// Names the file and what the system said.
pub fn check_writable(path: &Path) -> Result<(), Error> {
    let probe = || match fs::metadata(path) {
        Ok(found) if found.is_dir() => Err(std::io::ErrorKind::IsADirectory.into()),
        Ok(found) if !found.is_file() => Ok(()),
        _ => Builder::new().prefix(".turnlight-").tempfile_in(parent(path)).map(drop),
    };
    probe().map_err(|source| cannot_write(path, source))
}

/// Moves a file to the first of `places` where there is nothing, and says where; replaces nothing.
///
/// # Errors
/// Names the place and what the system said; where no place is free.
pub fn move_to_first_free(file: &Path, places: impl IntoIterator<Item = PathBuf>) -> Result<PathBuf, Error> {
    let mut file = TempPath::try_from_path(file).map_err(|source| cannot_write(file, source))?;
    for place in places.into_iter().filter(|place| !place.exists()) {
        match file.persist_noclobber(&place) {
            Ok(()) => return Ok(place),
            // Somebody was quicker.
            Err(refused) if place.exists() => file = refused.path,
            Err(refused) => return Err(cannot_write(&place, refused.error)),
        }
    }
    Err(all_taken(&file))
}

/// A folder under construction. Dropped without [`OutputFolder::finish`], it leaves nothing.
#[derive(Debug)]
pub struct OutputFolder {
    target: PathBuf,
    folder: TempDir,
}

impl OutputFolder {
    /// Starts a folder that will appear at `target`. What is there already must be a folder, which
    /// [`OutputFolder::finish`] replaces if it is empty or carries our mark.
    ///
    /// # Errors
    /// Where `target` is a file, or a folder of something else.
    pub fn create(target: &Path) -> Result<Self, Error> {
        refuse_foreign(target)?;
        let folder = Builder::new().prefix(".turnlight-").tempdir_in(parent(target));
        let folder = folder.map_err(|source| cannot_write(target, source))?;
        make_readable(folder.path(), 0o777).map_err(|source| cannot_write(target, source))?;
        let started = Self { target: target.to_path_buf(), folder };
        started.write(MARK, b"Written by turnlight, which may replace this folder.\n")?;
        Ok(started)
    }

    /// Where the folder is while it is being written.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Where a file below the folder is to be written; makes the folders above it.
    ///
    /// # Errors
    /// Names the file and what the system said.
    pub fn place(&self, relative: impl AsRef<Path>) -> Result<PathBuf, Error> {
        let path = self.folder.path().join(relative.as_ref());
        fs::create_dir_all(parent(&path)).map_err(|source| cannot_write(&self.target.join(relative), source))?;
        Ok(path)
    }

    /// Writes a file below the folder.
    ///
    /// # Errors
    /// Names the file and what the system said.
    pub fn write(&self, relative: impl AsRef<Path>, bytes: &[u8]) -> Result<(), Error> {
        let path = self.place(relative.as_ref())?;
        let write = || -> std::io::Result<()> {
            let mut file = fs::File::create(&path)?;
            file.write_all(bytes)?;
            file.sync_data()
        };
        write().map_err(|source| cannot_write(&self.target.join(relative), source))
    }

    /// Makes the folder appear at its place.
    ///
    /// # Errors
    /// Names the folder and what the system said.
    pub fn finish(self) -> Result<(), Error> {
        let replace = || -> std::io::Result<()> {
            if self.target.exists() {
                let old = Builder::new().prefix(".turnlight-old-").tempdir_in(parent(&self.target))?;
                fs::rename(&self.target, old.path().join("old"))?;
                if let Err(error) = fs::rename(self.folder.path(), &self.target) {
                    fs::rename(old.path().join("old"), &self.target)?;
                    return Err(error);
                }
                return Ok(());
            }
            fs::rename(self.folder.path(), &self.target)
        };
        replace().map_err(|source| cannot_write(&self.target, source))
    }

    /// Makes the folder appear at the first of `places` where there is nothing, and says where; replaces nothing.
    ///
    /// # Errors
    /// Names the place and what the system said; where no place is free.
    pub fn finish_at_first_free(self, places: impl IntoIterator<Item = PathBuf>) -> Result<PathBuf, Error> {
        for place in places.into_iter().filter(|place| !place.exists()) {
            match fs::rename(self.folder.path(), &place) {
                Ok(()) => return Ok(place),
                // Somebody was quicker; no system puts a folder in place of one that holds anything.
                Err(_) if place.exists() => {}
                Err(source) => return Err(cannot_write(&place, source)),
            }
        }
        Err(all_taken(&self.target))
    }
}

fn all_taken(path: &Path) -> Error {
    Error::Failed(format!("{}: all names like it are taken; move some of them away", path.display()))
}

/// Lies in every folder we write, so that a second run may replace it and nobody else's folder goes.
const MARK: &str = ".turnlight";

fn refuse_foreign(target: &Path) -> Result<(), Error> {
    let entries = match fs::read_dir(target) {
        Err(_) if !target.exists() => return Ok(()),
        entries => entries.map(Iterator::count),
    };
    let fault = match entries {
        Err(_) => "is there already and is no folder",
        Ok(0) => return Ok(()),
        Ok(_) if target.join(MARK).exists() => return Ok(()),
        Ok(_) => "is there already, with files that turnlight did not write",
    };
    Err(Error::Failed(format!("{}: {fault}; name another place or remove it", target.display())))
}

/// The folder that holds `path`.
pub(crate) fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn cannot_write(path: &Path, source: std::io::Error) -> Error {
    let remedy = match source.kind() {
        std::io::ErrorKind::StorageFull => "free some space or write elsewhere",
        std::io::ErrorKind::NotFound => "make the folder first",
        _ => "write elsewhere",
    };
    Error::Failed(format!("{}: cannot be written: {source}; {remedy}", path.display()))
}

/// Temporary files are private; give what becomes visible the usual rights.
#[cfg(unix)]
fn make_readable(path: &Path, mode: u32) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(path, fs::Permissions::from_mode(mode & !0o022))
}

#[cfg(not(unix))]
fn make_readable(_path: &Path, _mode: u32) -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_appears_only_when_finished_and_replaces_only_its_own() {
        let place = tempfile::tempdir().unwrap();
        let target = place.path().join("report");
        OutputFolder::create(&target).unwrap().write("a/b.txt", b"1").unwrap();
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0, "dropped without a trace");
        for content in [b"1", b"2"] {
            let folder = OutputFolder::create(&target).unwrap();
            folder.write("a/b.txt", content).unwrap();
            folder.finish().unwrap();
            assert_eq!(fs::read(target.join("a/b.txt")).unwrap(), content);
            assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1);
        }
        let foreign = place.path().join("mine");
        fs::create_dir(&foreign).unwrap();
        fs::write(foreign.join("thesis.tex"), "x").unwrap();
        assert!(OutputFolder::create(&foreign).is_err());
        assert!(OutputFolder::create(&foreign.join("thesis.tex")).is_err());
    }

    #[test]
    fn folders_begun_at_one_place_end_at_places_of_their_own() {
        let place = tempfile::tempdir().unwrap();
        let places = || ["a", "b"].map(|name| place.path().join(name));
        let begun = [b"1", b"2", b"3"].map(|content| {
            let folder = OutputFolder::create(&places()[0]).unwrap();
            folder.write("x.txt", content).unwrap();
            folder
        });
        let [first, second, third] = begun.map(|folder| folder.finish_at_first_free(places()));
        assert_eq!([first.unwrap(), second.unwrap()], places());
        assert!(third.is_err());
        assert_eq!(places().map(|path| fs::read(path.join("x.txt")).unwrap()), [b"1", b"2"]);
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 2);
    }

    #[test]
    fn a_file_goes_where_there_is_nothing() {
        let place = tempfile::tempdir().unwrap();
        let places = || ["1.mp4", "2.mp4"].map(|name| place.path().join(name));
        let move_one = |content: &[u8]| {
            let file = place.path().join("film");
            fs::write(&file, content).unwrap();
            move_to_first_free(&file, places())
        };
        assert_eq!([move_one(b"1").unwrap(), move_one(b"2").unwrap()], places());
        assert!(move_one(b"3").is_err());
        assert_eq!(places().map(|path| fs::read(path).unwrap()), [b"1", b"2"]);
    }

    #[test]
    fn a_file_that_cannot_be_written_leaves_nothing() {
        let place = tempfile::tempdir().unwrap();
        assert!(write_file(&place.path().join("none/x.glb"), b"x").is_err());
        write_file(&place.path().join("x.glb"), b"x").unwrap();
        assert!(write_file(place.path(), b"x").is_err(), "a folder is in the way");
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_place_is_known_to_take_no_file_before_there_is_one() {
        let place = tempfile::tempdir().unwrap();
        assert!(check_writable(&place.path().join("x.png")).is_ok());
        let refused = check_writable(&place.path().join("none/x.png")).unwrap_err().to_string();
        assert!(refused.contains("x.png") && refused.contains("make the folder first"), "{refused}");
        assert!(check_writable(place.path()).is_err(), "a folder is in the way");
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_named() {
        let Err(error) = write_file(Path::new("/dev/full"), b"x") else { panic!("/dev/full took it") };
        assert!(error.to_string().contains("free some space"), "{error}");
        assert!(Path::new("/dev/full").exists());
    }
}
