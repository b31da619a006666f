//! Dictionaries of square markers: which modules of marker `id` are light.

use super::BoardError;
use std::fmt;
use std::str::FromStr;

/// Where the codes of a dictionary come from.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Family {
    /// By id.
    Table(&'static [u64]),
    /// The first ArUco: five rows of two data bits each, spread to Hamming words.
    Original,
}

/// A set of square markers, told apart by their light and dark modules. Around the coded modules every
/// marker has a dark border one module wide.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Dictionary {
    name: &'static str,
    modules: usize,
    len: usize,
    family: Family,
}

static TABLE_4X4: [u64; 1000] = codes(include_bytes!("codes/4x4.txt"));
static TABLE_5X5: [u64; 1000] = codes(include_bytes!("codes/5x5.txt"));
static TABLE_6X6: [u64; 1000] = codes(include_bytes!("codes/6x6.txt"));
static TABLE_7X7: [u64; 1000] = codes(include_bytes!("codes/7x7.txt"));
static TABLE_36H11: [u64; 587] = codes(include_bytes!("codes/apriltag_36h11.txt"));

const F4: Family = Family::Table(&TABLE_4X4);
const F5: Family = Family::Table(&TABLE_5X5);
const F6: Family = Family::Table(&TABLE_6X6);
const F7: Family = Family::Table(&TABLE_7X7);
const APRIL: Family = Family::Table(&TABLE_36H11);

/// The `N` hexadecimal numbers of a text, without its lines that start with `#`. Evaluated by the compiler, which
/// refuses a text of more numbers or of other letters.
const fn codes<const N: usize>(text: &[u8]) -> [u64; N] {
    let mut codes = [0; N];
    let (mut found, mut at) = (0, 0);
    while at < text.len() {
        if text[at] == b'#' {
            while text[at] != b'\n' {
                at += 1;
            }
        } else if text[at].is_ascii_whitespace() {
            at += 1;
        } else {
            while !text[at].is_ascii_whitespace() {
                let digit = match text[at] {
                    digit @ b'0'..=b'9' => digit - b'0',
                    digit => digit - b'a' + 10,
                };
                assert!(digit < 16, "a hexadecimal digit");
                codes[found] = codes[found] << 4 | digit as u64;
                at += 1;
            }
            found += 1;
        }
    }
    assert!(found == N, "as many codes as the table holds");
    codes
}

const fn dictionary(name: &'static str, modules: usize, len: usize, family: Family) -> Dictionary {
    Dictionary { name, modules, len, family }
}

/// Every dictionary, in OpenCV's numbering but for the AprilTags.
const ALL: [Dictionary; 18] = [
    dictionary("4x4_50", 4, 50, F4),
    dictionary("4x4_100", 4, 100, F4),
    dictionary("4x4_250", 4, 250, F4),
    dictionary("4x4_1000", 4, 1000, F4),
    dictionary("5x5_50", 5, 50, F5),
    dictionary("5x5_100", 5, 100, F5),
    dictionary("5x5_250", 5, 250, F5),
    dictionary("5x5_1000", 5, 1000, F5),
    dictionary("6x6_50", 6, 50, F6),
    dictionary("6x6_100", 6, 100, F6),
    dictionary("6x6_250", 6, 250, F6),
    dictionary("6x6_1000", 6, 1000, F6),
    dictionary("7x7_50", 7, 50, F7),
    dictionary("7x7_100", 7, 100, F7),
    dictionary("7x7_250", 7, 250, F7),
    dictionary("7x7_1000", 7, 1000, F7),
    dictionary("aruco_original", 5, 1024, Family::Original),
    dictionary("apriltag_36h11", 6, 587, APRIL),
];

/// Five modules that stand for two bits in the first ArUco (Garrido-Jurado et al., 2014).
const HAMMING: [u64; 4] = [0b10000, 0b10111, 0b01001, 0b01110];

impl Dictionary {
    /// The smallest: the largest modules for a size of marker.
    pub const DICT_4X4_50: Self = ALL[0];

    /// Every dictionary known here.
    pub fn all() -> &'static [Self] {
        &ALL
    }

    /// Its name, as [`FromStr`] reads it: OpenCV's without `DICT_`, in lower case.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Coded modules along a side, without the border.
    pub fn modules(&self) -> usize {
        self.modules
    }

    /// How many markers it has: ids are below.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether it has no marker. None is.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The modules of marker `id`, row by row from the top left, most significant bit first, 1 = light;
    /// `None` where there is no such marker.
    pub fn code(&self, id: usize) -> Option<u64> {
        if id >= self.len {
            return None;
        }
        match self.family {
            Family::Original => Some((0..5).fold(0, |code, row| code << 5 | HAMMING[id >> (8 - 2 * row) & 3])),
            Family::Table(codes) => codes.get(id).copied(),
        }
    }

    /// Whether the module in `column` and `row`, border included (0 to `modules + 1`), is dark in a marker of
    /// this `code`.
    pub(super) fn is_dark(&self, code: u64, column: usize, row: usize) -> bool {
        let coded = 1..=self.modules;
        if !(coded.contains(&column) && coded.contains(&row)) {
            return true;
        }
        let place = (row - 1) * self.modules + (column - 1);
        code >> (self.modules * self.modules - 1 - place) & 1 == 0
    }
}

impl fmt::Debug for Dictionary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Dictionary({})", self.name)
    }
}

impl fmt::Display for Dictionary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl FromStr for Dictionary {
    type Err = BoardError;

    /// Reads a name in any case, with or without `DICT_` before it.
    fn from_str(text: &str) -> Result<Self, BoardError> {
        let name = text.trim().to_ascii_lowercase();
        let name = name.strip_prefix("dict_").unwrap_or(&name);
        ALL.iter().find(|known| known.name == name).copied().ok_or_else(|| {
            let known: Vec<_> = ALL.iter().map(|d| d.name).collect();
            BoardError::Text {
                text: text.to_owned(),
                fault: "is no dictionary".to_owned(),
                remedy: format!("use one of {}", known.join(", ")),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_dictionary_has_all_its_codes_and_no_more() {
        for dictionary in Dictionary::all() {
            let limit = 1_u64 << (dictionary.modules() * dictionary.modules());
            let last = dictionary.code(dictionary.len() - 1).unwrap();
            assert!(last < limit, "{dictionary}");
            assert_eq!(dictionary.code(dictionary.len()), None, "{dictionary}");
        }
    }

    /// What makes them usable: however a marker is turned, it differs from every other and from itself.
    #[test]
    fn no_two_markers_look_alike_in_any_of_four_turns() {
        for name in ["4x4_50", "5x5_250", "6x6_250", "apriltag_36h11"] {
            let dictionary: Dictionary = name.parse().unwrap();
            let n = dictionary.modules();
            let codes: Vec<u64> = (0..dictionary.len()).map(|id| dictionary.code(id).unwrap()).collect();
            let mut least = u32::MAX;
            for (i, &code) in codes.iter().enumerate() {
                let mut turned = code;
                for turn in 0..4 {
                    let others = codes[i..].iter().skip(usize::from(turn == 0));
                    least = others.map(|other| (other ^ turned).count_ones()).fold(least, u32::min);
                    turned = quarter_turn(turned, n);
                }
                assert_eq!(turned, code);
            }
            // Garrido-Jurado et al. (2014) build 4x4_50 to a distance of 4; 36h11 says its own.
            let promised = match name {
                "4x4_50" => 4,
                "5x5_250" => 6,
                "6x6_250" => 11,
                _ => 10,
            };
            assert!(least >= promised, "{name}: {least}");
        }
    }

    fn quarter_turn(code: u64, n: usize) -> u64 {
        let bit = |x: usize, y: usize| code >> (n * n - 1 - (y * n + x)) & 1;
        (0..n * n).fold(0, |turned, place| turned << 1 | bit(place / n, n - 1 - place % n))
    }

    #[test]
    fn names_are_read_in_opencv_spelling_too() {
        for dictionary in Dictionary::all() {
            assert_eq!(format!("DICT_{}", dictionary.name().to_uppercase()).parse(), Ok(*dictionary));
        }
        let fault = "4x4".parse::<Dictionary>().unwrap_err().to_string();
        assert!(fault.contains("4x4_50"), "{fault}");
    }
}
