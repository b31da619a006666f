//! Every flag of the command, once.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use turnlight::Selection;
use turnlight::capture::Board;
use turnlight::capture::board::{Dictionary, Paper, parse_length};
use turnlight::export::web::AXES;
use turnlight::render;
use turnlight::scene::MOST_OBJECTS;
use turnlight::swatch::Shape;
use turnlight::texture::btf::multilevel_vq::{ColorSpace, Measure, Variant};
use turnlight::texture::btf::{Budget, CodecKind, Precision};
use turnlight::viewer::Panel;

/// What this build can and cannot do.
const FILMS: &str = if cfg!(feature = "video") {
    "Built with films (.mp4 .mov .avi .mkv), through OpenCV."
} else {
    "Built without films (.mp4 .mov .avi .mkv): to read and write them, install libopencv-dev, clang and libclang-dev and build with \
     --features video."
};

/// Turns photographs of an object on a turntable into one that can be played back from any direction.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true, after_help = FILMS)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) general: General,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What every command takes.
#[derive(Debug, Args)]
pub(crate) struct General {
    /// Print one JSON document on standard output, and nothing else there
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Say nothing but errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Say more
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
    /// Use this many threads [default: one per core]
    #[arg(long, global = true, value_name = "N", value_parser = threads)]
    pub(crate) threads: Option<usize>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Time what this machine does
    #[command(subcommand)]
    Bench(BenchCommand),
    /// Draw a calibration board to print, to scale (.pdf .svg .png)
    Board(BoardArgs),
    /// Bidirectional texture functions: materials under all views and lights
    #[command(subcommand)]
    Btf(BtfCommand),
    /// Make a capture of a film or of photographs: frames, cameras, silhouettes, report
    Capture(CaptureFootageArgs),
    /// Compare the four methods on held-out views: table, plot, crops
    Compare(CompareArgs),
    /// Film a synthetic object, model it, compare the methods
    Demo(DemoArgs),
    /// Write a model for the browser, for Blender, or as a mesh with one picture
    Export(ExportArgs),
    /// Make the visual hull alone (.ply .obj .glb)
    Hull(HullArgs),
    /// Bring a calibrated folder of any known kind into our own
    Import(ImportArgs),
    /// Say what a capture, a mesh or a model holds, and check it
    Info(InfoArgs),
    /// Make a model: hull, atlas, appearance
    Model(ModelArgs),
    /// Draw a model: a picture per camera, a turntable, a film
    Render(RenderArgs),
    /// Render a synthetic capture whose truth is known
    Synth(SynthArgs),
    /// Make a capture of stills on a turntable from one calibrated camera, the axis and the angles
    Turntable(TurntableArgs),
    /// Show a model
    View(ViewArgs),
}

/// What is timed.
#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// Frames per second of models, stage by stage, against the speed of memory
    Playback(BenchPlaybackArgs),
}

#[derive(Debug, Args)]
pub(crate) struct BenchPlaybackArgs {
    /// Models to play [default: a bumpy ball of 20 layers of 512 x 512 texels]
    pub(crate) models: Vec<PathBuf>,
    /// Draw so many at once, taking the models in turn [default: 1, then 10]
    #[arg(long, value_name = "N", value_parser = objects)]
    pub(crate) objects: Option<usize>,
    /// Size of the frames
    #[arg(long, value_name = "WxH", default_value = "800x600", value_parser = size)]
    pub(crate) size: [usize; 2],
    /// Frames in the turn
    #[arg(long, value_name = "N", default_value = "300", value_parser = frames)]
    pub(crate) frames: usize,
    /// Seed of the ball
    #[arg(long, default_value = "1")]
    pub(crate) seed: u64,
    /// The file to write
    #[arg(short, long, value_name = "REPORT.json")]
    pub(crate) output: Option<PathBuf>,
}

/// What a model is exported to.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ExportTarget {
    /// A folder with a player, for any static web server
    Web,
    /// A folder with an add-on that imports the model and plays it for the camera
    Blender,
    /// Mesh, material and the static look (.obj .mtl .png)
    Obj,
}

/// How a page shows a model.
#[derive(Debug, Args)]
pub(crate) struct PageArgs {
    /// Axis that points up in the page: x, y, z, -x, -y, -z [default: that of the turntable, else z]
    #[arg(long, value_name = "AXIS", value_parser = AXES, allow_hyphen_values = true, hide_possible_values = true)]
    pub(crate) up: Option<String>,
}

impl PageArgs {
    /// The axis, if one is given.
    #[cfg(feature = "window")]
    pub(crate) fn axis(&self) -> Option<[f64; 3]> {
        self.up.as_deref().and_then(|name| axis(name).ok())
    }
}

#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// The model to export
    pub(crate) model: PathBuf,
    /// What to write
    #[arg(long, value_enum)]
    pub(crate) to: ExportTarget,
    #[command(flatten)]
    pub(crate) page: PageArgs,
    /// The folder to write
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct ViewArgs {
    /// The model to show, or a scene of several (.json); more than one are ways to see the same object
    #[arg(required = true, value_name = "MODEL")]
    pub(crate) models: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) page: PageArgs,
    #[command(flatten)]
    pub(crate) window: ViewWindowArgs,
    #[command(flatten)]
    pub(crate) web: ViewWebArgs,
}

/// How a window shows models.
#[derive(Debug, Args)]
#[command(next_help_heading = "In a window")]
pub(crate) struct ViewWindowArgs {
    /// Photographs to hold the model against
    #[arg(long, value_name = "CAPTURE", conflicts_with = "web")]
    pub(crate) capture: Option<PathBuf>,
    /// Size of the window
    #[arg(long, value_name = "WxH", default_value = "1200x800", value_parser = size, conflicts_with = "web")]
    pub(crate) size: [usize; 2],
    /// Panels to unfold: facets, directions, basis, light, capture, times, keys; none: the picture alone
    #[arg(long, value_name = "LIST", default_value = "times,keys", value_parser = panels, conflicts_with = "web")]
    pub(crate) panels: Panels,
    /// Who draws; pictures differ by a level at most, nearly everywhere
    #[arg(long, value_enum, default_value = "auto", conflicts_with = "web")]
    pub(crate) renderer: RendererArg,
    /// Write the first picture to this file and close
    #[arg(long, value_name = "FILE.png", conflicts_with = "web")]
    pub(crate) screenshot: Option<PathBuf>,
}

/// How a browser shows a model.
#[derive(Debug, Args)]
#[command(next_help_heading = "In a browser")]
pub(crate) struct ViewWebArgs {
    /// Show it in a browser: serve it to this machine alone, and print the address
    #[arg(long)]
    pub(crate) web: bool,
    /// Port to serve on; 0 takes any free one
    #[arg(long, value_name = "N", default_value = "0", requires = "web")]
    pub(crate) port: u16,
}

/// Panels to unfold; `None`: not even folded ones.
pub(crate) type Panels = Option<Vec<Panel>>;

/// What is done with bidirectional texture functions.
#[derive(Debug, Subcommand)]
pub(crate) enum BtfCommand {
    /// Measure a synthetic material whose truth is known
    Synth(BtfSynthArgs),
    /// Fit a codec to a measured material
    Fit(BtfFitArgs),
    /// Judge a coded material by the data it was fitted to
    Eval(BtfEvalArgs),
    /// Fit all codecs at several sizes, and compare size, error and speed
    Compare(BtfCompareArgs),
    /// Draw a coded material under light: flat, on a ball, a cloth or a mesh
    Render(BtfRenderArgs),
}

/// Measured data and how they are read.
#[derive(Clone, Debug, Args)]
pub(crate) struct BtfDataArgs {
    /// A folder of pictures named by angles, an .lp list of lights, a .btf or a .binary file
    pub(crate) data: PathBuf,
    /// Take the middle N × N texels alone
    #[arg(long, value_name = "N", value_parser = texels)]
    pub(crate) crop: Option<usize>,
}

/// How numbers are stored.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum PrecisionArg {
    /// 32-bit floats
    Full,
    /// 8 and 16 bits where they suffice
    Compact,
}

#[derive(Debug, Args)]
pub(crate) struct BtfFitArgs {
    /// Folders of pictures named by angles, .lp lists of lights, .btf or .binary files; several share one set of books
    #[arg(required = true)]
    pub(crate) data: Vec<PathBuf>,
    /// Take the middle N × N texels alone
    #[arg(long, value_name = "N", value_parser = texels)]
    pub(crate) crop: Option<usize>,
    /// The file to write
    #[arg(short, long, value_name = "FILE.btfz")]
    pub(crate) output: PathBuf,
    /// gaussian-mixture, multilevel-vq, pca, pca-view, local-pca, ptm, lafortune, gmrf, car2d or car3d
    #[arg(long, value_name = "NAME")]
    pub(crate) codec: CodecKind,
    #[command(flatten)]
    pub(crate) budget: BudgetArgs,
    /// How numbers are stored
    #[arg(long, value_enum, default_value = "compact")]
    pub(crate) precision: PrecisionArg,
    /// Seed of everything random
    #[arg(long, default_value = "1")]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) books: BookArgs,
}

/// What may be chosen of books.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "Books of multilevel-vq")]
pub(crate) struct BookArgs {
    /// How an item is found to stand for a slice
    #[arg(long, value_enum, default_value = "rmse")]
    pub(crate) measure: MeasureArg,
    /// How colours stand in the books
    #[arg(long, value_enum, default_value = "ycrcb")]
    pub(crate) color: ColorArg,
    /// Keep the smaller sizes too, down to one texel
    #[arg(long)]
    pub(crate) mip_maps: bool,
}

/// How an item is found to stand for a slice.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum MeasureArg {
    /// Root mean squared error
    Rmse,
    /// Structural similarity of 98 % of windows
    Ssim,
}

/// How colours stand in the books.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ColorArg {
    /// Luma and two differences of encoded samples
    Ycrcb,
    /// Logarithm of luminance, and chromaticity; of a high range
    Logluv,
}

/// How large a coded material may be; by default, what the codec's authors used.
#[derive(Clone, Copy, Debug, Args)]
#[group(multiple = false)]
pub(crate) struct BudgetArgs {
    /// Raw bytes over coded bytes, everything counted
    #[arg(long, value_name = "R", value_parser = ratio)]
    pub(crate) ratio: Option<f64>,
    /// From 0, small, to 100, faithful
    #[arg(long, value_name = "Q", value_parser = quality)]
    pub(crate) quality: Option<f64>,
    /// What the codec counts: components, clusters, coefficients; auto: as many as the data support
    #[arg(long, value_name = "M", value_parser = components)]
    pub(crate) components: Option<Auto<usize>>,
}

#[derive(Debug, Args)]
pub(crate) struct BtfEvalArgs {
    /// The coded material
    pub(crate) material: PathBuf,
    #[command(flatten)]
    pub(crate) data: BtfDataArgs,
    /// Which of the materials that share the file, counted from 0
    #[arg(long, value_name = "N", default_value = "0")]
    pub(crate) member: usize,
    /// Write original, decoded, and ten times their difference
    #[arg(long, value_name = "FILE.png")]
    pub(crate) sheet: Option<PathBuf>,
    /// Seed of the questions that are timed, and of synthesis
    #[arg(long, default_value = "1")]
    pub(crate) seed: u64,
}

#[derive(Debug, Args)]
pub(crate) struct BtfCompareArgs {
    #[command(flatten)]
    pub(crate) data: BtfDataArgs,
    /// The folder to write: report.html, report.json, pictures
    #[arg(short, long, value_name = "REPORT")]
    pub(crate) output: Option<PathBuf>,
    /// The codecs, by commas; all by default
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) codecs: Vec<CodecKind>,
    /// Ratios asked of each codec that can choose its size
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "50,100,200,500,1000,2000", value_parser = ratio)]
    pub(crate) ratios: Vec<f64>,
    /// How numbers are stored, by all alike
    #[arg(long, value_enum, default_value = "compact")]
    pub(crate) precision: PrecisionArg,
    /// Seed of everything random
    #[arg(long, default_value = "1")]
    pub(crate) seed: u64,
}

#[derive(Debug, Args)]
pub(crate) struct BtfRenderArgs {
    /// The coded material
    pub(crate) material: PathBuf,
    /// Which of the materials that share the file, counted from 0
    #[arg(long, value_name = "N", default_value = "0")]
    pub(crate) member: usize,
    /// The picture to write
    #[arg(short, long, value_name = "FILE.png")]
    pub(crate) output: PathBuf,
    /// tile, sphere, cloth, or a mesh with texture coordinates (.obj .ply .glb); z is up
    #[arg(long, default_value = "sphere")]
    pub(crate) shape: Shape,
    /// Repetitions across the picture of a tile, around a sphere, across a cloth, along a mesh's longest side
    #[arg(long, value_name = "N", default_value = "8", value_parser = tiles)]
    pub(crate) tiles: f64,
    /// Where it is seen from, in degrees: polar angle from +z, azimuth from +x [default: 62,-90; 0,0 of a tile]
    #[arg(long, value_name = "THETA,PHI", value_parser = angles, allow_hyphen_values = true)]
    pub(crate) view: Option<[f64; 2]>,
    /// Size of the picture
    #[arg(long, value_name = "WxH", default_value = "512x512", value_parser = size)]
    pub(crate) size: [usize; 2],
    /// What stands behind, 0 to 255 [default: nothing, transparent]
    #[arg(long, value_name = "R,G,B", value_parser = colour)]
    pub(crate) background: Option<[u8; 3]>,
    /// Sub-samples along a pixel's side; of shapes
    #[arg(long, value_name = "N", default_value = "2", value_parser = supersample)]
    pub(crate) supersample: usize,
    /// Seed of synthesis
    #[arg(long, default_value = "1")]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) light: LightArgs,
}

/// What shines on materials; several lights add up.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Light on materials")]
pub(crate) struct LightArgs {
    /// Towards a far light under which white paint is white [default: over the left shoulder of whoever looks]
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
    pub(crate) light: Option<[f64; 3]>,
    /// Place of a lamp, in the middle of the object as bright as a far light
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub(crate) point: Option<[f64; 3]>,
    /// Light from a panorama, longitude by latitude, +z at the top, +x in the middle (.exr; .png .jpg as sRGB)
    #[arg(long, value_name = "FILE")]
    pub(crate) environment: Option<PathBuf>,
    /// Far lights that stand for the panorama
    #[arg(long, value_name = "N", default_value = "32", requires = "environment", value_parser = lights)]
    pub(crate) environment_lights: usize,
    /// Brighten materials by so many stops
    #[arg(long, value_name = "STOPS", default_value = "0", value_parser = stops, allow_negative_numbers = true)]
    pub(crate) exposure: f64,
}

/// A material and where it lies.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MaterialArg {
    pub(crate) charts: Selection,
    pub(crate) file: PathBuf,
    pub(crate) tile_size: Option<f64>,
}

impl BookArgs {
    pub(crate) fn variant(self) -> Variant {
        let measure = match self.measure {
            MeasureArg::Rmse => Measure::Rmse,
            MeasureArg::Ssim => Measure::Ssim,
        };
        let color = match self.color {
            ColorArg::Ycrcb => ColorSpace::YCrCb,
            ColorArg::Logluv => ColorSpace::LogLuv,
        };
        Variant { measure, color, mip_maps: self.mip_maps }
    }
}

impl From<PrecisionArg> for Precision {
    fn from(arg: PrecisionArg) -> Self {
        match arg {
            PrecisionArg::Full => Self::Full,
            PrecisionArg::Compact => Self::Compact,
        }
    }
}

impl BudgetArgs {
    pub(crate) fn budget(&self) -> Budget {
        match (self.ratio, self.quality, self.components) {
            (Some(ratio), _, _) => Budget::Ratio(ratio),
            (_, Some(quality), _) => Budget::Quality(quality),
            (_, _, Some(Auto(Some(count)))) => Budget::Components(count),
            (_, _, Some(Auto(None))) => Budget::Auto,
            _ => Budget::Standard,
        }
    }
}

/// A calibrated folder and how it is read.
#[derive(Clone, Debug, Args)]
pub(crate) struct CaptureArgs {
    /// A calibrated folder of any known kind
    pub(crate) capture: PathBuf,
    #[command(flatten)]
    pub(crate) load: LoadArgs,
}

/// How views are read.
#[derive(Clone, Debug, Args)]
pub(crate) struct LoadArgs {
    /// Reduce images by this whole factor
    #[arg(long, value_name = "N", default_value = "1", value_parser = whole_factor)]
    pub(crate) downscale: usize,
    /// Find silhouettes in the photographs even where masks are given
    #[arg(long)]
    pub(crate) ignore_masks: bool,
}

/// How the shape is made.
#[derive(Clone, Debug, Args)]
pub(crate) struct ShapeArgs {
    /// Grid cells along the object's longest side, or auto: one to two pixels a cell
    #[arg(long, value_name = "N", default_value = "auto", value_parser = resolution)]
    pub(crate) resolution: Auto<usize>,
    /// Forgive this many silhouettes that cut where all others do not; auto: chosen on the views
    #[arg(long, value_name = "K", default_value = "auto", value_parser = consensus)]
    pub(crate) consensus: Auto<usize>,
    /// Grow silhouettes by this many pixels before carving; auto: chosen on the views
    #[arg(long, value_name = "PX", default_value = "auto", value_parser = grow, allow_negative_numbers = true)]
    pub(crate) grow: Auto<f64>,
}

/// How the mesh gets its atlas.
#[derive(Clone, Debug, Args)]
pub(crate) struct MeshArgs {
    #[command(flatten)]
    pub(crate) shape: ShapeArgs,
    /// Bring a mesh instead of making the hull (.obj .ply .glb); its texture coordinates are kept if valid
    #[arg(long, value_name = "FILE", conflicts_with_all = ["resolution", "consensus", "grow"])]
    pub(crate) mesh: Option<PathBuf>,
}

/// How the appearance is fitted.
#[derive(Clone, Debug, Args)]
pub(crate) struct FitArgs {
    /// Texture layers a texel may hold, source views of VDTM, rays of the lumigraph
    #[arg(long, value_name = "N", value_parser = whole_factor)]
    pub(crate) layers: Option<usize>,
    /// Take this many pixels off every silhouette before its colours are used
    #[arg(long, value_name = "PX", value_parser = pixels)]
    pub(crate) mask_erode: Option<f64>,
}

/// The appearances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodArg {
    /// A linear basis per facet
    Dyntex,
    /// One texture for all views
    Static,
    /// View-dependent texture mapping
    Vdtm,
    /// Unstructured lumigraph
    Lumigraph,
}

/// The patterns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BoardKind {
    /// A chessboard with markers in its light squares: a part of it is enough
    Charuco,
    /// Alternating squares: must be seen whole
    Chessboard,
    /// Markers in rows and columns
    Aruco,
}

#[derive(Debug, Args)]
pub(crate) struct BoardArgs {
    /// The sheet to write (.pdf .svg .png)
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// The pattern
    #[arg(long, value_enum, default_value = "charuco")]
    pub(crate) kind: BoardKind,
    /// Squares or markers from left to right
    #[arg(long, value_name = "N", default_value = "7", value_parser = whole_factor)]
    pub(crate) columns: usize,
    /// Squares or markers from top to bottom
    #[arg(long, value_name = "N", default_value = "5", value_parser = whole_factor)]
    pub(crate) rows: usize,
    /// Side of a square; of a marker and its gap where there are no squares
    #[arg(long, value_name = "LENGTH", default_value = "30mm", value_parser = length)]
    pub(crate) square: f64,
    /// Side of a marker [default: three quarters of a square]
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    pub(crate) marker: Option<f64>,
    /// Whose markers, as in 4x4_50, 5x5_100, 6x6_250, aruco_original, apriltag_36h11
    #[arg(long, default_value = "4x4_50")]
    pub(crate) dictionary: Dictionary,
    /// a4, a3, a2, a1, a0, letter or tabloid
    #[arg(long, default_value = "a4")]
    pub(crate) paper: Paper,
    /// Resolution of a .png
    #[arg(long, value_name = "N", default_value = "300", value_parser = dpi)]
    pub(crate) dpi: f64,
}

#[derive(Debug, Args)]
pub(crate) struct CaptureFootageArgs {
    /// Films (.mp4 .mov .avi .mkv where built with films), folders of photographs, or photographs; each film and
    /// folder may be taken from another height, with the same zoom
    #[arg(required = true)]
    pub(crate) footage: Vec<PathBuf>,
    /// The capture to write
    #[arg(short, long, value_name = "CAPTURE")]
    pub(crate) output: PathBuf,
    /// The board under the object, as its caption says: charuco:7x5:30mm:22.5mm:4x4_50 [default: found by looking]
    #[arg(long, value_name = "BOARD", conflicts_with = "cameras")]
    pub(crate) board: Option<Board>,
    /// Side of the board's squares (of its markers, where it has no squares) if it is found by looking, as in 30mm;
    /// gives the capture its scale
    #[arg(long, value_name = "LENGTH", value_parser = length, conflicts_with_all = ["board", "cameras"])]
    pub(crate) square: Option<f64>,
    /// Film or folder of photographs of a board waved before the same camera at the same zoom, for the lens
    #[arg(long, value_name = "FOOTAGE", conflicts_with = "cameras")]
    pub(crate) calibration: Option<PathBuf>,
    /// What moved [default: found out]
    #[arg(long, value_enum, conflicts_with = "cameras")]
    pub(crate) motion: Option<MotionArg>,
    /// Take the cameras from this calibrated folder of any known kind: by the names of photographs, by the numbers of a
    /// film's frames, counted from 0, or as a capture made of this film before has them
    #[arg(long, value_name = "CAPTURE")]
    pub(crate) cameras: Option<PathBuf>,
    /// Of --cameras take the first alone, for a camera that stands still, and turn the table evenly by this angle in
    /// degrees: from photograph to photograph, or in a second of a film
    #[arg(long, value_name = "DEG", requires = "cameras", value_parser = step, allow_negative_numbers = true)]
    pub(crate) step: Option<f64>,
    /// Direction of the axis, about which the object turns right-handed: x, y, z, -x, -y, -z or X,Y,Z [default: z]
    #[arg(long, value_name = "AXIS", requires = "step", value_parser = direction, allow_hyphen_values = true)]
    pub(crate) axis: Option<[f64; 3]>,
    /// A point on the axis, in the units of the camera [default: 0,0,0]
    #[arg(long, value_name = "X,Y,Z", requires = "step", value_parser = vector, allow_hyphen_values = true)]
    pub(crate) point: Option<[f64; 3]>,
    /// Have an installed COLMAP find the cameras, without a board, on what moves before a camera that stands still, or
    /// on the masks given
    #[arg(long, value_name = "PROGRAM", num_args = 0..=1, default_missing_value = "colmap", conflicts_with_all = ["cameras", "board", "square", "calibration", "motion"])]
    pub(crate) colmap: Option<PathBuf>,
    /// Take silhouettes from this folder: NAME.png of a photograph, the frame's number, counted from 0, of a film
    #[arg(long, value_name = "DIR", conflicts_with = "clean_plate")]
    pub(crate) masks: Option<PathBuf>,
    /// Picture of the set without object and table, one for every film or folder
    #[arg(long, value_name = "IMAGE")]
    pub(crate) clean_plate: Vec<PathBuf>,
    /// Outline of a shiny ball that stands in the room, in pixels, to a tenth of its radius: its highlight shows where the
    /// light is
    #[arg(long, value_name = "X,Y,RADIUS", value_parser = circle)]
    pub(crate) light_ball: Option<[f64; 3]>,
    /// Frames to keep at most [default: 72 a turn]
    #[arg(long, value_name = "N", value_parser = frames)]
    pub(crate) frames: Option<usize>,
    /// Make a model of the capture as well, as `turnlight model` does (.glb)
    #[arg(long, value_name = "MODEL.glb")]
    pub(crate) model: Option<PathBuf>,
}

/// What moves while it is filmed.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum MotionArg {
    /// The object turns, the camera stands still
    Turntable,
    /// The camera is carried, the object stands still
    FreeHand,
}

#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    #[command(flatten)]
    pub(crate) capture: CaptureArgs,
    /// Where the report goes: report.html, report.json, report.csv, views/
    #[arg(short, long, value_name = "REPORT")]
    pub(crate) output: Option<PathBuf>,
    /// Views to fit: all, even, odd, every:K, or a list like 0,4,9-12
    #[arg(long, default_value = "even")]
    pub(crate) train: Selection,
    /// Views to score; those fitted or within 2° of one are left out
    #[arg(long, default_value = "odd")]
    pub(crate) test: Selection,
    /// Methods to compare, comma-separated
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["static", "vdtm", "lumigraph", "dyntex"])]
    pub(crate) method: Vec<MethodArg>,
    #[command(flatten)]
    pub(crate) mesh: MeshArgs,
    #[command(flatten)]
    pub(crate) fit: FitArgs,
}

#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// Where everything goes
    #[arg(short, long, value_name = "DIR", default_value = "turnlight-demo")]
    pub(crate) output: PathBuf,
    /// Seed of the synthetic object
    #[arg(long, default_value = "1")]
    pub(crate) seed: u64,
}

#[derive(Debug, Args)]
pub(crate) struct HullArgs {
    #[command(flatten)]
    pub(crate) capture: CaptureArgs,
    /// The mesh to write (.ply .obj .glb)
    #[arg(short, long, value_name = "MESH")]
    pub(crate) output: PathBuf,
    /// Views to use: all, even, odd, every:K, or a list like 0,4,9-12
    #[arg(long, default_value = "all")]
    pub(crate) views: Selection,
    #[command(flatten)]
    pub(crate) shape: ShapeArgs,
}

#[derive(Debug, Args)]
pub(crate) struct ImportArgs {
    /// nerfstudio, instant-ngp, original NeRF, COLMAP (text, binary), Middlebury, projection matrices (text, .mat)
    pub(crate) path: PathBuf,
    /// The capture to write
    #[arg(short, long, value_name = "CAPTURE")]
    pub(crate) output: PathBuf,
    /// Find silhouettes in the photographs even where masks are given
    #[arg(long)]
    pub(crate) ignore_masks: bool,
}

#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// A capture, a mesh (.ply .obj .glb) or a model
    pub(crate) path: PathBuf,
    /// Hold the mesh or model against this true mesh (.ply .obj .glb): accuracy, completeness, bias
    #[arg(long, value_name = "MESH")]
    pub(crate) truth: Option<PathBuf>,
    /// Distance up to which the truth counts as covered, in the mesh's unit [default: 1 % of the truth's diagonal]
    #[arg(long, value_name = "LENGTH", requires = "truth", value_parser = tolerance)]
    pub(crate) tolerance: Option<f64>,
    /// Find silhouettes in the photographs even where masks are given
    #[arg(long)]
    pub(crate) ignore_masks: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ModelArgs {
    #[command(flatten)]
    pub(crate) capture: CaptureArgs,
    /// The model to write (.glb)
    #[arg(short, long, value_name = "MODEL.glb")]
    pub(crate) output: PathBuf,
    /// Views to use: all, even, odd, every:K, or a list like 0,4,9-12
    #[arg(long, default_value = "all")]
    pub(crate) views: Selection,
    /// The appearance
    #[arg(long, value_enum, default_value = "dyntex")]
    pub(crate) method: MethodArg,
    /// Lay a coded material over charts (all, or a list like 0,4,9-12) in place of what was photographed; SIZE of a
    /// tile in world units [default: as measured]; may be given again
    #[arg(long, value_name = "CHARTS=FILE[@SIZE]", value_parser = material)]
    pub(crate) material: Vec<MaterialArg>,
    #[command(flatten)]
    pub(crate) mesh: MeshArgs,
    #[command(flatten)]
    pub(crate) fit: FitArgs,
}

#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    /// The model to draw, or a scene of several (.json)
    pub(crate) model: PathBuf,
    /// Draw with the cameras of this capture; with --turntable, continue its orbit
    #[arg(long, value_name = "CAPTURE")]
    pub(crate) cameras: Option<PathBuf>,
    /// Cameras to use: all, even, odd, every:K, or a list like 0,4,9-12
    #[arg(long, default_value = "all", requires = "cameras")]
    pub(crate) views: Selection,
    /// Draw one turn of this many frames
    #[arg(long, value_name = "N", value_parser = frames)]
    pub(crate) turntable: Option<usize>,
    /// Fly smoothly through the cameras of this capture, as many frames as --frames says
    #[arg(long, value_name = "CAPTURE", conflicts_with_all = ["cameras", "turntable"])]
    pub(crate) path: Option<PathBuf>,
    /// Frames of the flight
    #[arg(long, value_name = "N", default_value = "120", requires = "path", value_parser = frames)]
    pub(crate) frames: usize,
    /// Where the pictures go, one PNG per camera
    #[arg(short, long, value_name = "DIR", required_unless_present = "video")]
    pub(crate) output: Option<PathBuf>,
    /// Write a film (.png .apng: animated; .mp4 .mov .avi .mkv where built with films)
    #[arg(long, value_name = "FILE")]
    pub(crate) video: Option<PathBuf>,
    /// Frames per second of the film
    #[arg(long, value_name = "N", default_value = "24", value_parser = rate)]
    pub(crate) fps: f64,
    /// Size of the frames, where no camera gives it
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(crate) size: Option<[usize; 2]>,
    /// Colour behind the object, levels from 0 to 255 [default: transparent]
    #[arg(long, value_name = "R,G,B", value_parser = colour)]
    pub(crate) background: Option<[u8; 3]>,
    /// Sub-samples along a pixel's side
    #[arg(long, value_name = "N", default_value = "2", value_parser = supersample)]
    pub(crate) supersample: usize,
    /// Axis of the turntable, where no capture gives it: x, y, z, -x, -y, -z
    #[arg(long, default_value = "z", value_parser = axis, allow_hyphen_values = true)]
    pub(crate) up: [f64; 3],
    /// Reduce the frames by this whole factor
    #[arg(long, value_name = "N", default_value = "1", value_parser = whole_factor)]
    pub(crate) downscale: usize,
    /// Who draws; pictures differ by a level at most, nearly everywhere
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) renderer: RendererArg,
    #[command(flatten)]
    pub(crate) light: LightArgs,
}

/// Who draws.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum RendererArg {
    /// Graphics hardware where this build and this machine have it
    Auto,
    /// The CPU
    Cpu,
    /// Graphics hardware, or a program that stands in for it; the CPU where there is neither
    Gpu,
}

#[derive(Debug, Args)]
pub(crate) struct SynthArgs {
    /// The scene: temple, elephant, house, wreath, mug, chrome, plate, knot, noise, glass, blank or jade
    pub(crate) scene: String,
    /// The capture to write
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Number of views [default: 48, 150 of a film]
    #[arg(long, value_name = "N", value_parser = frames)]
    pub(crate) views: Option<usize>,
    /// Size of the frames
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = size)]
    pub(crate) size: [usize; 2],
    /// Seed of everything random
    #[arg(long, default_value = "1")]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) footage: FootageArgs,
    #[command(flatten)]
    pub(crate) filming: FilmingArgs,
    #[command(flatten)]
    pub(crate) faults: FaultArgs,
}

/// What `synth` films as someone with a phone would.
#[derive(Debug, Args)]
pub(crate) struct FootageArgs {
    /// Film it on a board before a cloth, as with a phone (.mp4 .mov .avi .mkv where built with films; .png .apng:
    /// animated); the capture is then the film's truth
    #[arg(long, value_name = "FILE")]
    pub(crate) video: Option<PathBuf>,
    /// Colour of the cloth: green, blue, grey, black
    #[arg(long, value_name = "COLOUR", default_value = "green", requires = "video")]
    pub(crate) backdrop: String,
    /// Frames per second of the film
    #[arg(long, value_name = "N", default_value = "30", requires = "video", value_parser = rate)]
    pub(crate) fps: f64,
}

/// How a scene is filmed.
#[derive(Debug, Args)]
#[command(next_help_heading = "Filming")]
pub(crate) struct FilmingArgs {
    /// What the light is fixed to: the room, as on a turntable, or the object
    #[arg(long, default_value = "room", conflicts_with = "video")]
    pub(crate) light: LightArg,
    /// Where the cameras stand: on rings, on a spiral that climbs, or at random above the table
    #[arg(long, default_value = "rings", conflicts_with = "video")]
    pub(crate) layout: LayoutArg,
    /// Elevations in degrees: of the rings; of a film; of the spiral's ends; the lowest of random cameras
    #[arg(long, value_name = "DEG,..", value_delimiter = ',', allow_negative_numbers = true)]
    pub(crate) elevations: Option<Vec<f64>>,
    /// Full turns of the spiral, or of the film [default: 5, 1.05 of a film]
    #[arg(long, value_name = "N", value_parser = turns)]
    pub(crate) turns: Option<f64>,
    /// Paths of light per pixel [default: 32, 8 of a film]
    #[arg(long, value_name = "N", value_parser = samples)]
    pub(crate) samples: Option<u32>,
    /// Trace as many paths as it takes for this noise over the object, in levels of 255 (instead of --samples); at
    /// most 4096 on a pixel
    #[arg(long, value_name = "LEVELS", value_parser = levels, conflicts_with_all = ["samples", "video"])]
    pub(crate) noise: Option<f64>,
    /// Write radiance, depth, normals and noise of every view as truth/NNNN.exr
    #[arg(long, conflicts_with = "video")]
    pub(crate) maps: bool,
}

/// What goes wrong; nothing unless asked for, in a film what a phone does.
#[derive(Debug, Args)]
#[command(next_help_heading = "Faults")]
pub(crate) struct FaultArgs {
    /// Noise of a sensor that is white at this many electrons, with ten of read noise (a phone: 5000)
    #[arg(long, value_name = "ELECTRONS")]
    pub(crate) sensor_noise: Option<f64>,
    /// Exposure that drifts from view to view by so many stops (standard deviation)
    #[arg(long, value_name = "STOPS")]
    pub(crate) exposure_drift: Option<f64>,
    /// Cameras that stand and point off by so many degrees (standard deviation), and are known
    #[arg(long, value_name = "DEG", default_value = "0", conflicts_with = "video")]
    pub(crate) jitter: f64,
    /// Cameras written with an error of so many pixels (standard deviation)
    #[arg(long, value_name = "PX", default_value = "0", conflicts_with = "video")]
    pub(crate) calibration_error: f64,
    /// Masks grown by so many pixels; negative shrinks
    #[arg(long, value_name = "PX", default_value = "0", allow_negative_numbers = true, conflicts_with = "video")]
    pub(crate) mask_grow: f64,
    /// Round holes in every mask
    #[arg(long, value_name = "N", default_value = "0", conflicts_with = "video")]
    pub(crate) mask_holes: usize,
    /// Turn of the table while the shutter is open, in degrees
    #[arg(long, value_name = "DEG", default_value = "0")]
    pub(crate) motion_blur: f64,
    /// Radial distortion k1 of the lens, known
    #[arg(long, value_name = "K1", allow_negative_numbers = true)]
    pub(crate) distortion: Option<f64>,
}

#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("turn").required(true))]
pub(crate) struct TurntableArgs {
    /// The folder of the photographs, taken in the order of their names; masks are found beside them or in masks/
    pub(crate) photographs: PathBuf,
    /// The capture to write
    #[arg(short, long, value_name = "CAPTURE")]
    pub(crate) output: PathBuf,
    /// A capture, or transforms.json, with the calibrated camera of the first photograph
    #[arg(long, value_name = "CAPTURE")]
    pub(crate) camera: PathBuf,
    /// Which of its views
    #[arg(long, value_name = "N", default_value = "0")]
    pub(crate) view: usize,
    /// Direction of the axis, about which the object turns right-handed: x, y, z, -x, -y, -z or X,Y,Z
    #[arg(long, value_name = "AXIS", default_value = "z", value_parser = direction, allow_hyphen_values = true)]
    pub(crate) axis: [f64; 3],
    /// A point on the axis, in the units of the camera
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", value_parser = vector, allow_hyphen_values = true)]
    pub(crate) point: [f64; 3],
    /// The table turned by this angle from photograph to photograph, in degrees
    #[arg(long, value_name = "DEG", group = "turn", value_parser = step, allow_negative_numbers = true)]
    pub(crate) step: Option<f64>,
    /// A text file with the angle of each photograph in degrees, one a line: in the order of their names, or after the
    /// name of the photograph (`IMG_0012.jpg 37.5`), in any order
    #[arg(long, value_name = "FILE", group = "turn")]
    pub(crate) angles: Option<PathBuf>,
}

/// What the light is fixed to.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum LightArg {
    Room,
    Object,
}

/// How cameras are spread.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum LayoutArg {
    Rings,
    Spiral,
    Hemisphere,
}

#[derive(Debug, Args)]
pub(crate) struct BtfSynthArgs {
    /// The material: corduroy, knit, weave, leather, bark, foil, or analytic
    #[arg(value_name = "NAME")]
    pub(crate) material: String,
    /// The folder to write: a picture per view and light, btf.json
    #[arg(short, long, value_name = "DATA")]
    pub(crate) output: PathBuf,
    /// Texels per side of the tile
    #[arg(long, value_name = "TEXELS", default_value = "24", value_parser = texels)]
    pub(crate) size: usize,
    /// Write linear floats (.exr) instead of 8 bits (.png)
    #[arg(long)]
    pub(crate) hdr: bool,
    /// Seed of everything random
    #[arg(long, default_value = "1")]
    pub(crate) seed: u64,
    /// Paths per texel and view
    #[arg(long, value_name = "N", default_value = "16", value_parser = samples)]
    pub(crate) samples: u32,
}

/// A value, or left to us.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Auto<T>(pub(crate) Option<T>);

fn resolution(text: &str) -> Result<Auto<usize>, String> {
    auto(text, |text| bounded(text, 3000))
}

fn consensus(text: &str) -> Result<Auto<usize>, String> {
    auto(text, |text| text.parse().map_err(|fault| format!("needs a number of views or auto: {fault}")))
}

fn grow(text: &str) -> Result<Auto<f64>, String> {
    auto(text, |text| within(text, -64.0, 64.0))
}

fn components(text: &str) -> Result<Auto<usize>, String> {
    auto(text, |text| bounded(text, 65_536))
}

fn ratio(text: &str) -> Result<f64, String> {
    within(text, 1.0, 1e7)
}

fn quality(text: &str) -> Result<f64, String> {
    within(text, 0.0, 100.0)
}

fn auto<T>(text: &str, parse: impl Fn(&str) -> Result<T, String>) -> Result<Auto<T>, String> {
    if text == "auto" { Ok(Auto(None)) } else { parse(text).map(|value| Auto(Some(value))) }
}

fn bounded(text: &str, most: usize) -> Result<usize, String> {
    match text.parse() {
        Ok(value) if (1..=most).contains(&value) => Ok(value),
        _ => Err(format!("needs a whole number from 1 to {most}")),
    }
}

fn threads(text: &str) -> Result<usize, String> {
    bounded(text, 1024)
}

fn whole_factor(text: &str) -> Result<usize, String> {
    bounded(text, 256)
}

fn frames(text: &str) -> Result<usize, String> {
    bounded(text, 100_000)
}

fn objects(text: &str) -> Result<usize, String> {
    bounded(text, MOST_OBJECTS)
}

fn supersample(text: &str) -> Result<usize, String> {
    bounded(text, render::MAX_SUPERSAMPLE)
}

fn lights(text: &str) -> Result<usize, String> {
    bounded(text, 4096)
}

fn stops(text: &str) -> Result<f64, String> {
    within(text, -64.0, 64.0)
}

fn tiles(text: &str) -> Result<f64, String> {
    within(text, 0.01, 10_000.0)
}

fn angles(text: &str) -> Result<[f64; 2], String> {
    let (polar, azimuth) = text.split_once(',').ok_or("needs two angles in degrees, as in 30,90")?;
    Ok([within(polar.trim(), 0.0, 180.0)?, within(azimuth.trim(), -360.0, 360.0)?])
}

fn colour(text: &str) -> Result<[u8; 3], String> {
    let levels: Vec<u8> = text.split(',').filter_map(|word| word.trim().parse().ok()).collect();
    match levels.as_slice() {
        &[r, g, b] if text.split(',').count() == 3 => Ok([r, g, b]),
        _ => Err("needs three levels from 0 to 255, as in 255,255,255".to_owned()),
    }
}

fn material(text: &str) -> Result<MaterialArg, String> {
    let (charts, file) =
        text.split_once('=').ok_or("needs charts and a file, as in all=wool.btfz or 0,4=wool.btfz@0.02")?;
    let charts = charts.parse().map_err(|fault: String| format!("charts: {fault}"))?;
    let sized = file.rsplit_once('@').and_then(|(file, size)| Some((file, size.parse::<f64>().ok()?)));
    match sized {
        Some((_, size)) if !(size > 0.0 && size.is_finite()) => Err(format!("a tile cannot measure {size}")),
        Some((file, size)) => Ok(MaterialArg { charts, file: file.into(), tile_size: Some(size) }),
        None => Ok(MaterialArg { charts, file: file.into(), tile_size: None }),
    }
}

fn texels(text: &str) -> Result<usize, String> {
    bounded(text, 1024)
}

fn samples(text: &str) -> Result<u32, String> {
    bounded(text, 65_536).map(|n| n as u32)
}

fn size(text: &str) -> Result<[usize; 2], String> {
    let (width, height) = text.split_once(['x', 'X', '×']).ok_or("needs WIDTHxHEIGHT, as in 640x480")?;
    Ok([bounded(width, 1 << 14)?, bounded(height, 1 << 14)?])
}

fn pixels(text: &str) -> Result<f64, String> {
    within(text, 0.0, 1000.0)
}

fn circle(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<Option<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match parts[..] {
        [Some(x), Some(y), Some(radius)] if x.is_finite() && y.is_finite() && radius > 1.0 && radius.is_finite() => {
            Ok([x, y, radius])
        }
        _ => Err("needs column, row and radius of a circle in pixels, as in 320,240,25".to_owned()),
    }
}

fn tolerance(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| value.is_finite() && *value >= 0.0);
    value.ok_or_else(|| "needs a length of 0 or more, in the mesh's unit".to_owned())
}

fn turns(text: &str) -> Result<f64, String> {
    within(text, 0.01, 1000.0)
}

fn levels(text: &str) -> Result<f64, String> {
    within(text, 0.05, 64.0)
}

fn rate(text: &str) -> Result<f64, String> {
    within(text, 0.02, 650.0)
}

fn dpi(text: &str) -> Result<f64, String> {
    within(text, 30.0, 2400.0)
}

fn length(text: &str) -> Result<f64, String> {
    parse_length(text).map_err(|fault| fault.to_string())
}

fn within(text: &str, least: f64, most: f64) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (least..=most).contains(&value) => Ok(value),
        _ => Err(format!("needs a number from {least} to {most}")),
    }
}

fn axis(text: &str) -> Result<[f64; 3], String> {
    let (sign, name) = text.strip_prefix('-').map_or((1.0, text), |name| (-1.0, name));
    match name {
        "x" => Ok([sign, 0.0, 0.0]),
        "y" => Ok([0.0, sign, 0.0]),
        "z" => Ok([0.0, 0.0, sign]),
        _ => Err("needs x, y, z, -x, -y or -z".to_owned()),
    }
}

fn vector(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|word| word.trim().parse().ok()).collect();
    match numbers.as_slice() {
        &[x, y, z] if text.split(',').count() == 3 && [x, y, z].iter().all(|v| v.is_finite()) => Ok([x, y, z]),
        _ => Err("needs three numbers, as in 0,0.1,-2".to_owned()),
    }
}

fn direction(text: &str) -> Result<[f64; 3], String> {
    let named_or_given = axis(text).or_else(|_| vector(text));
    named_or_given
        .ok()
        .filter(|v| v.iter().any(|c| *c != 0.0))
        .ok_or_else(|| "needs x, y, z, -x, -y, -z, or three numbers that are not all zero, as in 0,0.1,1".to_owned())
}

fn panels(text: &str) -> Result<Panels, String> {
    if text == "none" { Ok(None) } else { text.split(',').map(str::parse).collect::<Result<_, _>>().map(Some) }
}

fn step(text: &str) -> Result<f64, String> {
    within(text, -180.0, 180.0).and_then(|step| if step == 0.0 { Err("must not be 0".to_owned()) } else { Ok(step) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_browser_takes_nothing_that_is_for_a_window() {
        let read = |args: &[&str]| Cli::try_parse_from([&["turnlight", "view", "m.glb"], args].concat());
        assert!(read(&["--web"]).is_ok());
        for option in [["--size", "40x30"], ["--panels", "none"], ["--renderer", "cpu"], ["--screenshot", "s.png"]] {
            assert!(read(&option).is_ok() && read(&[&option[..], &["--web"]].concat()).is_err(), "{option:?}");
        }
    }

    #[test]
    fn values_out_of_range_are_refused() {
        for text in ["nan", "inf", "1e9", "", "x"] {
            assert!(grow(text).is_err(), "{text}");
        }
        assert_eq!(grow("auto"), Ok(Auto(None)));
        assert_eq!(grow("-0.5"), Ok(Auto(Some(-0.5))));
        assert_eq!(size("640x480"), Ok([640, 480]));
        for text in ["640", "0x5", "5x0", "99999x99999", "axb"] {
            assert!(size(text).is_err(), "{text}");
        }
        for text in ["nan", "inf", "-1", "1 mm"] {
            assert!(tolerance(text).is_err(), "{text}");
        }
        assert_eq!(tolerance("1.25e-3"), Ok(0.00125));
        assert_eq!(length("30mm"), Ok(0.03));
        assert_eq!(axis("-y"), Ok([0.0, -1.0, 0.0]));
        assert_eq!(direction("-1,0,2e-1"), Ok([-1.0, 0.0, 0.2]));
        for text in ["0,0,0", "1,2", "1,2,3,4", "1,,2", "nan,0,1", "w"] {
            assert!(direction(text).is_err(), "{text}");
        }
        assert_eq!(angles("30, -90"), Ok([30.0, -90.0]));
        assert_eq!(colour("1,2,255"), Ok([1, 2, 255]));
        assert!(angles("30").is_err() && angles("nan,1").is_err() && colour("1,2,256").is_err());
        let laid = material("0,4-5=some@home.btfz@0.5").expect("a material");
        assert_eq!((laid.charts, laid.tile_size), (Selection::List(vec![0, 4, 5]), Some(0.5)));
        assert_eq!(laid.file, PathBuf::from("some@home.btfz"));
        assert_eq!(material("all=m.btfz").map(|m| m.tile_size), Ok(None));
        assert!(material("m.btfz").is_err() && material("x=m").is_err() && material("all=m@0").is_err());
        assert!(step("0").is_err() && step("-10") == Ok(-10.0));
    }
}
