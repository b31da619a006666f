//! Pictures and turns written to files.

use super::App;
use crate::Error;
#[cfg(feature = "video")]
use crate::film::Film;
use crate::output::OutputFolder;
#[cfg(feature = "video")]
use crate::output::move_to_first_free;
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

/// A film's name in its folder.
#[cfg(feature = "video")]
const STAGED: &str = "turn.mp4";

/// Frames of a film a second: a turn in three.
#[cfg(feature = "video")]
const FPS: f64 = 24.0;

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
    /// What it is named by.
    name: String,
    reel: Reel,
    cameras: Vec<Camera>,
    next: usize,
}

/// Where its pictures go.
enum Reel {
    /// A folder of them.
    Pictures(OutputFolder),
    /// A film, in a folder of its own until it is whole.
    #[cfg(feature = "video")]
    Film(Box<Film>, OutputFolder),
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
            return Some(self.begin(viewer, size).unwrap_or_else(|fault| fault.to_string()));
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

    /// Says what the turn is written as.
    fn begin(&mut self, viewer: &Viewer<'_>, size: [usize; 2]) -> Result<String, Error> {
        // Films have even sides.
        let even = size.map(|side| side / 2 * 2);
        let folder = OutputFolder::create(&free_name(&self.name, TURN))?;
        let (reel, size, kind) = match film(folder, even) {
            Ok(reel) => (reel, even, "writing a film".to_owned()),
            Err((folder, fault)) => (Reel::Pictures(folder), size, format!("writing pictures: {fault}")),
        };
        let cameras = viewer.orbit().turn(TURN_FRAMES, size);
        self.turn = Some(Turn { name: self.name.clone(), reel, cameras, next: 0 });
        Ok(kind)
    }
}

/// The folder back, and why, where this build or this machine writes none.
#[cfg(feature = "video")]
fn film(folder: OutputFolder, size: [usize; 2]) -> Result<Reel, (OutputFolder, String)> {
    match folder.place(STAGED).and_then(|path| Film::create(&path, size, FPS)) {
        Ok(film) => Ok(Reel::Film(Box::new(film), folder)),
        Err(fault) => Err((folder, fault.to_string())),
    }
}

#[cfg(not(feature = "video"))]
fn film(folder: OutputFolder, _: [usize; 2]) -> Result<Reel, (OutputFolder, String)> {
    Err((folder, "this turnlight was built without films".to_owned()))
}

enum Written {
    More(Turn),
    All(PathBuf),
}

impl Turn {
    fn advance(mut self, viewer: &mut Viewer<'_>) -> Result<Written, Error> {
        let Some(camera) = self.cameras.get(self.next) else { return Ok(Written::All(self.reel.finish(&self.name)?)) };
        self.reel.push(self.next, &viewer.frame_of(camera))?;
        self.next += 1;
        Ok(Written::More(self))
    }
}

impl Reel {
    fn push(&mut self, number: usize, frame: &Image<[u8; 4]>) -> Result<(), Error> {
        match self {
            Self::Pictures(folder) => Ok(write_png(&folder.place(format!("{number:04}.png"))?, frame)?),
            #[cfg(feature = "video")]
            Self::Film(film, _) => film.push(frame),
        }
    }

    /// Makes it appear at the first free name, and says where: another window may have taken that of the start.
    fn finish(self, name: &str) -> Result<PathBuf, Error> {
        match self {
            Self::Pictures(folder) => folder.finish_at_first_free(numbered(name, TURN)),
            #[cfg(feature = "video")]
            Self::Film(film, folder) => {
                film.finish()?;
                move_to_first_free(&folder.place(STAGED)?, numbered(name, FILM))
            }
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
            let hint = format!("{TURN_FRAMES} views all around, as a film or pictures in the current folder (T)");
            if ui.button("Turn").on_hover_text(hint).clicked() {
                self.recorder.ask_turn();
            }
        });
    }
}
