use super::*;
use crate::write_rgb;

fn folder_of(names: &[(&str, [usize; 2])]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (i, (name, [width, height])) in names.iter().enumerate() {
        write_rgb(&folder.path().join(name), &Image::filled(*width, *height, [i as u8; 3])).unwrap();
    }
    folder
}

#[test]
fn photographs_come_in_the_order_of_their_numbers() {
    let folder = folder_of(&[("p10.png", [4, 3]), ("p9.png", [4, 3]), (".p1.png", [4, 3])]);
    std::fs::write(folder.path().join("notes.txt"), "no photograph").unwrap();
    let footage = Footage::open(&[folder.path().to_owned()]).unwrap();
    let frames: Vec<FootageFrame> = footage.frames().map(Result::unwrap).collect();
    let found: Vec<_> = frames.iter().map(|f| (f.source.name.as_str(), f.source.time_s, f.image.at(0, 0)[0])).collect();
    assert_eq!(found, [("p9.png", 0.0, 1), ("p10.png", 1.0, 0)]);
    assert_eq!(footage.path(), folder.path());
}

#[test]
fn masks_beside_photographs_are_no_photographs() {
    let names = ["p1.png", "p1.mask.png", "p2.png", "p2.mask.png", "dynamic_mask_p1.png"];
    let folder = folder_of(&names.map(|name| (name, [4, 3])));
    let footage = Footage::open(&[folder.path().to_owned()]).unwrap();
    let found: Vec<String> = footage.photographs().into_iter().map(|source| source.name).collect();
    assert_eq!(found, ["p1.png", "p2.png"]);
}

#[test]
fn photographs_and_films_in_one_folder_are_refused() {
    let folder = folder_of(&[("1.png", [4, 3]), ("2.png", [4, 3])]);
    std::fs::write(folder.path().join(".a.mp4"), "hidden").unwrap();
    assert!(Footage::open(&[folder.path().to_owned()]).is_ok());
    std::fs::write(folder.path().join("a.MP4"), "text").unwrap();
    let fault = Footage::open(&[folder.path().to_owned()]).unwrap_err().to_string();
    assert!(fault.contains("photographs (2)") && fault.contains("films (1)"), "{fault}");
}

#[test]
fn folders_are_takes_and_photographs_named_one_by_one_are_one() {
    let (a, b) = (folder_of(&[("1.png", [4, 3])]), folder_of(&[("1.png", [4, 3]), ("2.png", [4, 3])]));
    let takes = |paths: &[PathBuf]| -> Vec<usize> {
        let footage = Footage::open(paths).unwrap();
        footage.frames().map(|f| f.unwrap().source.take).collect()
    };
    assert_eq!(takes(&[a.path().to_owned(), b.path().join("1.png"), b.path().join("2.png")]), [0, 1, 1]);
    assert_eq!(takes(&[b.path().join("1.png"), a.path().to_owned(), b.path().to_owned()]), [0, 1, 2, 2]);
}

#[test]
fn a_frame_of_another_size_ends_the_footage_with_its_name() {
    let folder = folder_of(&[("1.png", [4, 3]), ("2.png", [3, 4]), ("3.png", [4, 3])]);
    let footage = Footage::open(&[folder.path().to_owned()]).unwrap();
    let frames: Vec<_> = footage.frames().collect();
    assert_eq!(frames.len(), 2);
    let fault = frames[1].as_ref().unwrap_err().to_string();
    assert!(fault.contains("2.png") && fault.contains("3x4"), "{fault}");
}

#[test]
fn what_is_no_footage_is_refused_with_a_remedy() {
    let empty = tempfile::tempdir().unwrap();
    let fault = Footage::open(&[empty.path().to_owned()]).unwrap_err().to_string();
    assert!(fault.contains("no photographs"), "{fault}");
    assert!(Footage::open(&[empty.path().join("missing.mp4")]).is_err());
    std::fs::write(empty.path().join("a.mp4"), "text").unwrap();
    let footage = Footage::open(&[empty.path().to_owned()]).unwrap();
    assert!(footage.has_film());
    let fault = footage.frames().next().unwrap().unwrap_err().to_string();
    assert!(fault.contains("a.mp4"), "{fault}");
    std::fs::write(empty.path().join("b.mov"), "text").unwrap();
    assert!(Footage::open(&[empty.path().to_owned()]).unwrap_err().to_string().contains("several films"));
}

#[test]
fn a_photograph_is_turned_as_the_camera_was_held() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("held.jpg");
    let mut picture = image::RgbImage::from_pixel(32, 16, image::Rgb([200, 200, 200]));
    (0..8).for_each(|y| (0..8).for_each(|x| picture.put_pixel(x, y, image::Rgb([0, 0, 0]))));
    picture.save(&path).unwrap();
    let jpeg = std::fs::read(&path).unwrap();
    // APP1 with one entry: orientation (0x0112) 6, "rotate a quarter turn clockwise to see it upright".
    let exif = *b"\xff\xe1\x00\x22Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    std::fs::write(&path, [&jpeg[..2], &exif, &jpeg[2..]].concat()).unwrap();
    let upright = read_upright(&path).unwrap();
    assert_eq!((upright.width(), upright.height()), (16, 32));
    assert!(upright.at(13, 2)[0] < 40 && upright.at(2, 2)[0] > 160);
}

#[test]
fn the_focal_length_is_what_the_photographs_agree_on() {
    let folder = folder_of(&[("1.jpg", [40, 30]), ("2.jpg", [40, 30]), ("3.jpg", [40, 30])]);
    let image = ::image::RgbImage::from_pixel(40, 30, ::image::Rgb([90; 3]));
    let note = |name: &str, length: u16| {
        let path = folder.path().join(name);
        image.save(&path).unwrap();
        let notes = crate::exif::tests::notes(&[(0xa405, length)], &[]);
        let size = (8 + notes.len() as u16).to_be_bytes();
        let mut bytes = std::fs::read(&path).unwrap();
        // After the two bytes that begin a JPEG.
        bytes.splice(2..2, [&[0xff, 0xe1][..], &size, b"Exif\0\0", &notes].concat());
        std::fs::write(&path, bytes).unwrap();
    };
    let told = || Footage::open(&[folder.path().to_owned()]).unwrap().noted_focal_px([40, 30]);
    image.save(folder.path().join("3.jpg")).unwrap();
    ["1.jpg", "2.jpg"].iter().for_each(|name| note(name, 28));
    assert!((told().unwrap() - 28.0 / 43.267 * 50.0).abs() < 1e-6, "{:?}", told());
    note("2.jpg", 35);
    assert_eq!(told(), None);
}
