//! Cameras from an installed COLMAP (Schönberger, Frahm: *Structure-from-motion revisited*, CVPR 2016), where there is
//! no board. Features are taken on the object alone: what stands still while the object turns would pin the cameras to
//! the room. Scale and orientation of the world are COLMAP's own; its result may differ a little from run to run.

use crate::Error;
use crate::stages::Stages;
use capture::footage::read_upright;
use capture::{Camera, Capture, Intrinsics, read_matte, read_rgb, write_matte, write_rgb};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// How COLMAP is run.
#[derive(Clone, Debug)]
pub struct ColmapOptions {
    /// The program, by name or path.
    pub program: PathBuf,
    /// The lens, where it is known; otherwise one focal length and one coefficient of distortion are sought, with the
    /// principal point in the middle. More cannot be told on one ring of cameras.
    pub lens: Option<Intrinsics>,
}

/// A photograph whose camera is wanted.
#[derive(Clone, Debug)]
pub struct Photograph {
    /// The image file.
    pub image: PathBuf,
    /// A mask of where the object is, of the size of the image held upright; everywhere if `None`. Read when its turn
    /// comes: masks of many photographs need not fit into memory.
    pub mask: Option<PathBuf>,
}

/// What COLMAP found.
#[derive(Clone, Debug)]
pub struct ColmapCameras {
    /// The camera of each photograph that the largest model holds; all in one world, all with the same lens.
    pub cameras: Vec<Option<Camera>>,
    /// Models found; more than one means that the photographs fell apart.
    pub models: usize,
}

/// Lines of COLMAP's last words that a fault shows.
const LAST_WORDS: usize = 3;

impl Default for ColmapOptions {
    fn default() -> Self {
        Self { program: PathBuf::from("colmap"), lens: None }
    }
}

/// Runs COLMAP on photographs of one camera, in a folder of its own that is gone afterwards.
///
/// # Errors
/// Where COLMAP is not installed, fails, or finds no cameras; the message says what to do.
pub fn find_cameras(
    photographs: &[Photograph],
    options: &ColmapOptions,
    stages: &mut Stages<'_>,
) -> Result<ColmapCameras, Error> {
    // Before any work: whether it is there.
    run(options, "help", &[])?;
    let place = tempfile::Builder::new().prefix("turnlight-colmap-").tempdir();
    let place = place.map_err(|fault| Error::Failed(format!("no temporary folder: {fault}; set TMPDIR to another")))?;
    let place = place.path();
    let names = stage(photographs, place)?;
    stages.run("find features", |_| extract(options, place))?;
    stages.run("match features", |_| match_features(options, place))?;
    stages.run("find cameras", |_| map(options, place))?;
    largest_model(&place.join("sparse"), &names)
}

/// Lays photographs and masks out as COLMAP wants them; their names there, in order.
fn stage(photographs: &[Photograph], place: &Path) -> Result<Vec<String>, Error> {
    let [images, masks, sparse] = ["images", "masks", "sparse"].map(|name| place.join(name));
    for folder in [&images, &masks, &sparse] {
        fs::create_dir_all(folder).map_err(|fault| cannot(folder, &fault))?;
    }
    let mut names = Vec::with_capacity(photographs.len());
    for (i, photograph) in photographs.iter().enumerate() {
        let name = lay(&photograph.image, &images, i)?;
        if let Some(mask) = &photograph.mask {
            // COLMAP takes whatever is not zero.
            let mask = read_matte(mask)?.map(|v| if v >= 128 { 255 } else { 0 });
            write_matte(&masks.join(format!("{name}.png")), &mask)?;
        }
        names.push(name);
    }
    Ok(names)
}

/// Lays one photograph out upright, as its matte is; its name there. What EXIF says of the orientation is done here, so that
/// COLMAP need not heed it; files that are upright stay as they are, with what EXIF says of the focal length.
fn lay(image: &Path, folder: &Path, position: usize) -> Result<String, Error> {
    let upright = read_upright(image)?;
    if read_rgb(image)? != upright {
        let name = format!("{position:06}.png");
        write_rgb(&folder.join(&name), &upright)?;
        return Ok(name);
    }
    let extension = image.extension().and_then(|e| e.to_str()).unwrap_or("png");
    let name = format!("{position:06}.{extension}");
    let to = folder.join(&name);
    // The file itself: a link to a relative symbolic link leads nowhere.
    let from = fs::canonicalize(image).map_err(|fault| cannot(image, &fault))?;
    // A link costs nothing; across disks it must be a copy.
    let laid = fs::hard_link(&from, &to).or_else(|_| fs::copy(&from, &to).map(|_| ()));
    laid.map_err(|fault| cannot(image, &fault))?;
    Ok(name)
}

fn extract(options: &ColmapOptions, place: &Path) -> Result<(), Error> {
    let [database, images, masks] = ["database.db", "images", "masks"].map(|name| text(&place.join(name)));
    let mut arguments = vec!["--database_path", &database, "--image_path", &images];
    let (model, parameters) =
        options.lens.as_ref().map_or(("SIMPLE_RADIAL", None), |lens| ("FULL_OPENCV", Some(parameters(lens))));
    arguments.extend(["--ImageReader.single_camera", "1", "--ImageReader.camera_model", model]);
    if let Some(parameters) = &parameters {
        arguments.extend(["--ImageReader.camera_params", parameters]);
    }
    if fs::read_dir(place.join("masks")).is_ok_and(|mut found| found.next().is_some()) {
        arguments.extend(["--ImageReader.mask_path", &masks]);
    }
    // On the graphics card it needs a screen; the name of the option changed with version 3.12.
    let known = run(options, "feature_extractor", &["-h"])?;
    arguments.extend(first_known(&known, &["--FeatureExtraction.use_gpu", "--SiftExtraction.use_gpu"], "0"));
    run(options, "feature_extractor", &arguments).map(|_| ())
}

/// A lens as COLMAP's `FULL_OPENCV`: fx, fy, cx, cy, k1, k2, p1, p2, k3 and three that are not ours.
fn parameters(lens: &Intrinsics) -> String {
    let d = lens.distortion;
    let all = [lens.fx, lens.fy, lens.cx, lens.cy, d.k1, d.k2, d.p1, d.p2, d.k3, 0.0, 0.0, 0.0];
    all.map(|v| v.to_string()).join(",")
}

/// Matches all pairs, which takes about a second each.
fn match_features(options: &ColmapOptions, place: &Path) -> Result<(), Error> {
    let database = text(&place.join("database.db"));
    let known = run(options, "exhaustive_matcher", &["-h"])?;
    let mut arguments = vec!["--database_path", &database];
    arguments.extend(first_known(&known, &["--FeatureMatching.use_gpu", "--SiftMatching.use_gpu"], "0"));
    run(options, "exhaustive_matcher", &arguments).map(|_| ())
}

fn map(options: &ColmapOptions, place: &Path) -> Result<(), Error> {
    let [database, images, sparse] = ["database.db", "images", "sparse"].map(|name| text(&place.join(name)));
    let mut arguments = vec!["--database_path", &database, "--image_path", &images, "--output_path", &sparse];
    if options.lens.is_some() {
        arguments.extend(["--Mapper.ba_refine_focal_length", "0", "--Mapper.ba_refine_extra_params", "0"]);
    }
    run(options, "mapper", &arguments).map(|_| ())
}

/// The first of the options that this version's help names, with its value.
fn first_known<'a>(help: &str, names: &[&'a str], value: &'a str) -> Vec<&'a str> {
    names.iter().find(|name| help.contains(*name)).map(|name| vec![*name, value]).unwrap_or_default()
}

/// Reads every model and keeps the one with the most cameras, the first of equals.
fn largest_model(sparse: &Path, names: &[String]) -> Result<ColmapCameras, Error> {
    let mut folders: Vec<PathBuf> = fs::read_dir(sparse)
        .map_err(|fault| cannot(sparse, &fault))?
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    let mut largest: Vec<Option<Camera>> = vec![None; names.len()];
    for folder in &folders {
        let model = Capture::read(folder)?;
        let camera = |name: &String| {
            let is_it = |frame: &&capture::Frame| frame.image_path.file_name().is_some_and(|n| n == name.as_str());
            model.frames.iter().find(is_it).map(|frame| frame.camera)
        };
        let cameras: Vec<Option<Camera>> = names.iter().map(camera).collect();
        if cameras.iter().flatten().count() > largest.iter().flatten().count() {
            largest = cameras;
        }
    }
    if largest.iter().all(Option::is_none) {
        let remedy = "take more views that overlap, of an object with more detail, or film it on a board";
        return Err(Error::Failed(format!("COLMAP found no cameras of {} photographs; {remedy}", names.len())));
    }
    Ok(ColmapCameras { cameras: largest, models: folders.len() })
}

/// Runs one command of COLMAP; what it printed.
fn run(options: &ColmapOptions, command: &str, arguments: &[&str]) -> Result<String, Error> {
    let program = options.program.display();
    let started = Command::new(&options.program).arg(command).args(arguments).output();
    let output = started.map_err(|fault| match fault.kind() {
        ErrorKind::NotFound => Error::Failed(format!(
            "{program}: COLMAP is not installed; install it (Debian: apt-get install colmap; else https://colmap.github.io), \
             give a model it made elsewhere, or film the object on a board (turnlight board)"
        )),
        _ => Error::Failed(format!("{program}: cannot be started: {fault}; check the program")),
    })?;
    let printed = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    if output.status.success() {
        return Ok(printed);
    }
    Err(Error::Failed(format!(
        "{program} {command} failed ({}): {}; look into the photographs and masks, or run COLMAP by hand",
        ending(&output),
        last_words(&printed)
    )))
}

fn ending(output: &Output) -> String {
    output.status.code().map_or_else(|| "killed, out of memory?".to_owned(), |code| format!("code {code}"))
}

fn last_words(printed: &str) -> String {
    let lines: Vec<&str> = printed.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    lines[lines.len().saturating_sub(LAST_WORDS)..].join(" / ")
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

fn cannot(path: &Path, fault: &std::io::Error) -> Error {
    Error::Failed(format!("{}: {fault}; check the path and the space on the disk", path.display()))
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use crate::stages::Silent;
    use capture::{Distortion, Image};
    use std::os::unix::fs::PermissionsExt;

    /// A program in the place of COLMAP that writes down how it was called, and does what `mapper` says.
    fn fake(folder: &Path, mapper: &str) -> ColmapOptions {
        let program = folder.join("colmap");
        let script = format!(
            "#!/bin/sh\necho \"$@\" >> {log}\ncase \"$1 $2\" in\n\
             *' -h') echo ' --SiftExtraction.use_gpu arg (=1) --SiftMatching.use_gpu arg (=1)' ;;\n\
             'feature_extractor '*) ls \"$7/../\" \"$5\" >> {log}; ls $5/../masks >> {log} ;;\n\
             'mapper '*) out=$7; {mapper} ;;\nesac\n",
            log = folder.join("log").display()
        );
        fs::write(&program, script).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        ColmapOptions { program, ..ColmapOptions::default() }
    }

    const MODEL: &str = "printf '1 PINHOLE 8 6 9 9 4 3\\n' > $out/$m/cameras.txt";

    fn photographs(folder: &Path, count: usize) -> Vec<Photograph> {
        let photograph = |i| {
            let image = folder.join(format!("shot {i}.png"));
            write_rgb(&image, &Image::filled(8, 6, [5; 3])).unwrap();
            let mask = folder.join(format!("mask {i}.png"));
            write_matte(&mask, &Image::filled(8, 6, 200)).unwrap();
            Photograph { image, mask: Some(mask) }
        };
        (0..count).map(photograph).collect()
    }

    fn find(mapper: &str) -> (Result<ColmapCameras, String>, String) {
        let folder = tempfile::tempdir().unwrap();
        let options = fake(folder.path(), mapper);
        let found = find_cameras(&photographs(folder.path(), 3), &options, &mut Stages::new(&Silent));
        let log = fs::read_to_string(folder.path().join("log")).unwrap();
        (found.map_err(|fault| fault.to_string()), log)
    }

    #[test]
    fn the_largest_model_gives_the_cameras() {
        let mapper = format!(
            "for m in 0 1; do mkdir $out/$m; {MODEL}; done; printf '1 1 0 0 0 0 0 5 1 000000.png\\n\\n' > $out/0/images.txt; \
             printf '1 1 0 0 0 0 0 7 1 000002.png\\n\\n2 1 0 0 0 1 0 7 1 000001.png\\n\\n' > $out/1/images.txt"
        );
        let (found, log) = find(&mapper);
        let found = found.unwrap();
        assert_eq!(found.models, 2);
        assert_eq!(found.cameras.iter().map(Option::is_some).collect::<Vec<_>>(), [false, true, true]);
        assert_eq!(found.cameras[1].unwrap().translation, nalgebra::Vector3::new(1.0, 0.0, 7.0));
        assert!(log.contains("000001.png.png"), "masks are named as COLMAP wants them: {log}");
        assert!(log.contains("--SiftExtraction.use_gpu 0") && !log.contains("FeatureExtraction"), "{log}");
        assert!(log.contains("exhaustive_matcher"), "{log}");
    }

    #[test]
    fn a_known_lens_is_given_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let distortion = Distortion { k1: -0.06, k3: 0.001, ..Distortion::default() };
        let lens = Intrinsics { fx: 9.5, fy: 9.0, skew: 0.0, cx: 4.0, cy: 3.0, distortion, width: 8, height: 6 };
        let options = ColmapOptions { lens: Some(lens), ..fake(folder.path(), "true") };
        let none = find_cameras(&photographs(folder.path(), 2), &options, &mut Stages::new(&Silent));
        assert!(none.is_err());
        let log = fs::read_to_string(folder.path().join("log")).unwrap();
        assert!(log.contains("FULL_OPENCV --ImageReader.camera_params 9.5,9,4,3,-0.06,0,0,0,0.001,0,0,0"), "{log}");
        assert!(log.contains("--Mapper.ba_refine_focal_length 0"), "{log}");
    }

    #[test]
    fn photographs_are_laid_out_upright_and_symbolic_links_followed() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        write_rgb(&place("shot.png"), &Image::filled(8, 6, [5; 3])).unwrap();
        std::os::unix::fs::symlink("shot.png", place("link.png")).unwrap();
        // An eXIf chunk after the header (8 + 25 bytes), with one entry: orientation (0x0112) 6, a quarter turn.
        let mut bytes = fs::read(place("shot.png")).unwrap();
        let exif = *b"\0\0\0\x1aeXIfMM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0\xd6gKi";
        bytes.splice(33..33, exif);
        fs::write(place("held.png"), bytes).unwrap();
        let shots = ["link.png", "held.png"].map(|name| Photograph { image: place(name), mask: None });
        assert_eq!(stage(&shots, folder.path()).unwrap(), ["000000.png", "000001.png"]);
        let laid = |name: &str| place("images").join(name);
        assert!(fs::symlink_metadata(laid("000000.png")).unwrap().is_file());
        let held = read_rgb(&laid("000001.png")).unwrap();
        assert_eq!([held.width(), held.height()], [6, 8]);
    }

    #[test]
    fn no_model_says_what_to_film() {
        let (found, _) = find("true");
        let fault = found.unwrap_err();
        assert!(fault.contains("found no cameras of 3 photographs") && fault.contains("board"), "{fault}");
    }

    #[test]
    fn a_failure_passes_on_its_last_words() {
        let (found, _) = find("echo 'no good initial pair' >&2; exit 1");
        let fault = found.unwrap_err();
        assert!(fault.contains("mapper failed (code 1): no good initial pair"), "{fault}");
    }

    #[test]
    fn without_colmap_the_remedy_is_named() {
        let options = ColmapOptions { program: PathBuf::from("/none/colmap"), ..ColmapOptions::default() };
        let fault = find_cameras(&[], &options, &mut Stages::new(&Silent)).unwrap_err().to_string();
        assert!(fault.contains("not installed") && fault.contains("apt-get install colmap"), "{fault}");
    }
}
