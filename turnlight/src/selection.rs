//! Which views of a capture are meant: `all`, `even`, `odd`, `every:K`, or a list `0,4,9-12`, by
//! position in file order.

use crate::Error;
use std::str::FromStr;

/// A choice of views.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Selection {
    /// Every view.
    All,
    /// Positions 0, 2, 4, …
    Even,
    /// Positions 1, 3, 5, …
    Odd,
    /// Positions 0, K, 2K, …
    Every(usize),
    /// The positions listed, ascending and without repeats.
    List(Vec<usize>),
}

/// The longest list accepted: more than any capture has, and little enough to hold.
const MAX_POSITION: usize = 10_000_000;

impl Selection {
    /// The positions meant among `count` views, ascending.
    ///
    /// # Errors
    /// Where the list names a position the capture does not have, or nothing is left.
    pub fn positions(&self, count: usize) -> Result<Vec<usize>, Error> {
        let chosen: Vec<usize> = match self {
            Self::All => (0..count).collect(),
            Self::Even => (0..count).step_by(2).collect(),
            Self::Odd => (1..count).step_by(2).collect(),
            Self::Every(step) => (0..count).step_by((*step).max(1)).collect(),
            Self::List(list) => list.clone(),
        };
        match chosen.last() {
            None => Err(Error::Arguments(format!("no view is chosen of the {count} in the capture; choose others"))),
            Some(last) if *last >= count => Err(Error::Arguments(format!(
                "view {last} is chosen, but the capture has {count} (numbered from 0); choose others"
            ))),
            Some(_) => Ok(chosen),
        }
    }
}

impl FromStr for Selection {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim() {
            "all" => Ok(Self::All),
            "even" => Ok(Self::Even),
            "odd" => Ok(Self::Odd),
            text => match text.strip_prefix("every:") {
                Some(step) => parse_step(step),
                None => parse_list(text).map(Self::List),
            },
        }
    }
}

fn parse_step(text: &str) -> Result<Selection, String> {
    match text.parse() {
        Ok(step) if step > 0 => Ok(Selection::Every(step)),
        _ => Err(format!("'every:{text}' needs a whole number above zero, as in every:3")),
    }
}

fn parse_list(text: &str) -> Result<Vec<usize>, String> {
    let mut positions = Vec::new();
    for item in text.split(',') {
        let (first, last) = item.split_once('-').unwrap_or((item, item));
        let (first, last) = (parse_position(first, text)?, parse_position(last, text)?);
        if first > last {
            return Err(format!("'{item}' runs backwards; write {last}-{first}"));
        }
        positions.extend(first..=last);
    }
    positions.sort_unstable();
    positions.dedup();
    Ok(positions)
}

fn parse_position(text: &str, whole: &str) -> Result<usize, String> {
    let wrong = |_| format!("'{whole}' is none of all, even, odd, every:K or a list like 0,4,9-12");
    let position: usize = text.trim().parse().map_err(wrong)?;
    if position > MAX_POSITION { Err(format!("no capture has a view {position}")) } else { Ok(position) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn positions(text: &str, count: usize) -> Vec<usize> {
        text.parse::<Selection>().unwrap().positions(count).unwrap()
    }

    #[test]
    fn every_spelling_is_read() {
        assert_eq!(positions("all", 3), [0, 1, 2]);
        assert_eq!(positions("even", 5), [0, 2, 4]);
        assert_eq!(positions("odd", 5), [1, 3]);
        assert_eq!(positions("every:3", 8), [0, 3, 6]);
        assert_eq!(positions("9-12,0,4,10", 20), [0, 4, 9, 10, 11, 12]);
    }

    #[test]
    fn nonsense_is_refused() {
        for text in ["", "every:0", "every:x", "4-2", "a", "1,,2", "-1", "99999999999999999999", "0-999999999999"] {
            assert!(text.parse::<Selection>().is_err(), "{text}");
        }
        assert!("5".parse::<Selection>().unwrap().positions(5).is_err());
        assert!(Selection::Odd.positions(1).is_err());
    }
}
