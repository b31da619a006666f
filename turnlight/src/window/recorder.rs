//! Pictures and turns written to files.

use super::App;
use crate::Error;
use crate::output::OutputFolder;
use crate::viewer::Viewer;
use ::capture::Camera;
use render::film::write_png;
use render::path::TURN_FRAMES;
use render::window::egui::Ui;
use std::path::PathBuf;

/// Files of one kind and name that are told apart by number.
const MOST_FILES: usize = 10_000;

/// What names of pictures, and of folders of turns, end with.
const PICTURE: &str = ".png";
const TURN: &str = "-turn";

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
    folder: OutputFolder,
    /// What the folder is named by.
    name: String,
    cameras: Vec<Camera>,
    next: usize,
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
        let folder = OutputFolder::create(&free_name(&self.name, TURN))?;
        let cameras = viewer.orbit().turn(TURN_FRAMES, size);
        self.turn = Some(Turn { folder, name: self.name.clone(), cameras, next: 0 });
        Ok(())
    }
}

enum Written {
    More(Turn),
    All(PathBuf),
}

impl Turn {
    fn advance(mut self, viewer: &mut Viewer<'_>) -> Result<Written, Error> {
        let Some(camera) = self.cameras.get(self.next) else {
            // Another window may have taken the name that was free at the start.
            return Ok(Written::All(self.folder.finish_at_first_free(numbered(&self.name, TURN))?));
        };
        let place = self.folder.place(format!("{:04}.png", self.next))?;
        write_png(&place, &viewer.frame_of(camera))?;
        self.next += 1;
        Ok(Written::More(self))
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
            let hint = format!("{TURN_FRAMES} PNGs in a new folder of the current one (T)");
            if ui.button("Turn").on_hover_text(hint).clicked() {
                self.recorder.ask_turn();
            }
        });
    }
}
