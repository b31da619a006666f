//! Pictures and turns written to files.

use super::App;
use crate::Error;
#[cfg(feature = "video")]
use crate::film::Film;
use crate::output::OutputFolder;
use crate::viewer::Viewer;
use ::capture::{Camera, Image};
use render::film::write_png;
use render::path::TURN_FRAMES;
use render::window::egui::Ui;
use std::path::PathBuf;

/// Files of one kind and name that are told apart by number.
const MOST_FILES: usize = 10_000;

/// What names of pictures, of folders of turns and of films of them end with.
const PICTURE: &str = ".png";
const TURN: &str = "-turn";
#[cfg(feature = "video")]
const FILM: &str = ".mp4";

/// Frames of a film a second: a turn in three.
#[cfg(feature = "video")]
const FPS: f64 = 24.0;

/// What a turn is written as.
pub(super) const TURN_KIND: &str = if cfg!(feature = "video") { "film" } else { "pictures" };

/// What is being written.
pub(super) struct Recorder {
    /// What files are named by.
    name: String,
    /// Where the first picture goes, after which all is done.
    first: Option<PathBuf>,
    outcome: Option<Result<(), Error>>,
    wants_picture: bool,
    wants_turn: bool,
    turn: Option<Turn>,
}

/// A turn that is being written, a picture a frame of the window.
struct Turn {
    reel: Reel,
    cameras: Vec<Camera>,
    next: usize,
}

/// Where its pictures go.
enum Reel {
    /// A folder, and what it is named by.
    Pictures(OutputFolder, String),
    /// A film, and its file.
    #[cfg(feature = "video")]
    Film(Box<Film>, PathBuf),
}

impl Recorder {
    pub(super) fn new(name: String, first: Option<PathBuf>) -> Self {
        Self { name, first, outcome: None, wants_picture: false, wants_turn: false, turn: None }
    }

    pub(super) fn ask_picture(&mut self) {
        self.wants_picture = true;
    }

    pub(super) fn ask_turn(&mut self) {
        self.wants_turn = self.turn.is_none();
    }

    /// Whether there is more to write.
    pub(super) fn is_busy(&self) -> bool {
        self.turn.is_some()
    }

    /// Whether the one picture asked for is written, or cannot be.
    pub(super) fn is_done(&self) -> bool {
        self.outcome.is_some()
    }

    /// What became of that picture.
    pub(super) fn finish(self) -> Result<(), Error> {
        self.outcome.unwrap_or(Ok(()))
    }

    /// Writes what is next; says what came of it.
    pub(super) fn advance(&mut self, viewer: &mut Viewer<'_>, size: [usize; 2]) -> Option<String> {
        if let Some(path) = self.first.take() {
            let written = write_png(&path, &viewer.frame(size));
            self.outcome = Some(written.map_err(Error::from));
        }
        if std::mem::take(&mut self.wants_picture) {
            return Some(self.picture(viewer, size).unwrap_or_else(|fault| fault.to_string()));
        }
        if std::mem::take(&mut self.wants_turn) {
            return Some(
                self.begin(viewer, size).map_or_else(|fault| fault.to_string(), |()| "writing a turn".to_owned()),
            );
        }
        let turn = self.turn.take()?;
        match turn.advance(viewer) {
            Ok(Written::More(turn)) => {
                let message = format!("writing picture {} of {}", turn.next, turn.cameras.len());
                self.turn = Some(turn);
                Some(message)
            }
            Ok(Written::All(path)) => Some(format!("wrote {}", path.display())),
            Err(fault) => Some(fault.to_string()),
        }
    }

    fn picture(&self, viewer: &mut Viewer<'_>, size: [usize; 2]) -> Result<String, Error> {
        let path = free_name(&self.name, PICTURE);
        write_png(&path, &viewer.frame(size))?;
        Ok(format!("wrote {}", path.display()))
    }

    fn begin(&mut self, viewer: &Viewer<'_>, size: [usize; 2]) -> Result<(), Error> {
        // Films have even sides.
        let even = size.map(|side| side / 2 * 2);
        let (reel, size) = match film(&self.name, even) {
            Some(film) => (film, even),
            None => {
                let folder = OutputFolder::create(&free_name(&self.name, TURN))?;
                (Reel::Pictures(folder, self.name.clone()), size)
            }
        };
        self.turn = Some(Turn { reel, cameras: viewer.orbit().turn(TURN_FRAMES, size), next: 0 });
        Ok(())
    }
}

/// `None` where this build or this machine writes none.
#[cfg(feature = "video")]
fn film(name: &str, size: [usize; 2]) -> Option<Reel> {
    let path = free_name(name, FILM);
    let film = Film::create(&path, size, FPS).ok()?;
    Some(Reel::Film(Box::new(film), path))
}

#[cfg(not(feature = "video"))]
fn film(_: &str, _: [usize; 2]) -> Option<Reel> {
    None
}

enum Written {
    More(Turn),
    All(PathBuf),
}

impl Turn {
    fn advance(mut self, viewer: &mut Viewer<'_>) -> Result<Written, Error> {
        let Some(camera) = self.cameras.get(self.next) else { return Ok(Written::All(self.reel.finish()?)) };
        self.reel.push(self.next, &viewer.frame_of(camera))?;
        self.next += 1;
        Ok(Written::More(self))
    }
}

impl Reel {
    fn push(&mut self, number: usize, frame: &Image<[u8; 4]>) -> Result<(), Error> {
        match self {
            Self::Pictures(folder, _) => Ok(write_png(&folder.place(format!("{number:04}.png"))?, frame)?),
            #[cfg(feature = "video")]
            Self::Film(film, _) => film.push(frame),
        }
    }

    /// Makes it appear at its place, and says where.
    fn finish(self) -> Result<PathBuf, Error> {
        match self {
            // Another window may have taken the name that was free at the start.
            Self::Pictures(folder, name) => folder.finish_at_first_free(numbered(&name, TURN)),
            #[cfg(feature = "video")]
            Self::Film(film, path) => film.finish().map(|()| path),
        }
    }
}

/// `NAME-001.png` and so on.
fn numbered(name: &str, end: &str) -> impl Iterator<Item = PathBuf> {
    (1..=MOST_FILES).map(move |k| PathBuf::from(format!("{name}-{k:03}{end}")))
}

/// The first of them that is not there; where all are, the last.
fn free_name(name: &str, end: &str) -> PathBuf {
    let free = numbered(name, end).find(|path| !path.exists());
    free.or_else(|| numbered(name, end).last()).unwrap_or_default()
}

impl App<'_> {
    pub(super) fn files(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            if ui.button("Picture").on_hover_text("as it is, to a PNG in the current folder (S)").clicked() {
                self.recorder.ask_picture();
            }
            let hint = format!("{TURN_FRAMES} views all around, as {TURN_KIND} in the current folder (T)");
            if ui.button("Turn").on_hover_text(hint).clicked() {
                self.recorder.ask_turn();
            }
        });
    }
}
