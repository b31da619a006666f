//! Set algebra on one ray.

/// A part `enter ≤ t < leave` of a ray and how many views have it outside their silhouette.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub(super) enter: f64,
    pub(super) leave: f64,
    pub(super) misses: u32,
}

/// Spans and gaps shorter than this (in cells) are rounding.
pub(super) const SHORTEST: f64 = 1e-9;

/// Counts one more view: what lies outside the intervals `[inside[0], inside[1])`, `[inside[2], …` gains a
/// miss, and what has more than `allowed` is dropped. `inside` ascends and may reach to ±infinity.
pub(super) fn carve(spans: &mut Vec<Span>, scratch: &mut Vec<Span>, inside: &[f64], allowed: u32) {
    scratch.clear();
    let mut first = 0;
    for span in spans.iter() {
        let mut at = span.enter;
        while first + 1 < inside.len() && inside[first + 1] <= span.enter {
            first += 2;
        }
        for pair in inside[first..].chunks_exact(2) {
            if pair[0] >= span.leave {
                break;
            }
            push(scratch, at, pair[0], span.misses + 1, allowed);
            at = at.max(pair[0]);
            let end = pair[1].min(span.leave);
            push(scratch, at, end, span.misses, allowed);
            at = at.max(end);
        }
        push(scratch, at, span.leave, span.misses + 1, allowed);
    }
    std::mem::swap(spans, scratch);
}

fn push(spans: &mut Vec<Span>, enter: f64, leave: f64, misses: u32, allowed: u32) {
    if leave > enter && misses <= allowed {
        spans.push(Span { enter, leave, misses });
    }
}

/// Appends the union of the spans as alternating crossings, enter and leave, without slivers.
pub(super) fn append_crossings(spans: &[Span], crossings: &mut Vec<f64>) {
    let mut rest = spans.iter().peekable();
    while let Some(span) = rest.next() {
        let mut leave = span.leave;
        while let Some(next) = rest.next_if(|next| next.enter - leave < SHORTEST) {
            leave = next.leave;
        }
        if leave - span.enter >= SHORTEST {
            crossings.extend([span.enter, leave]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crossings(views: &[&[f64]], allowed: u32) -> Vec<f64> {
        let mut spans = vec![Span { enter: 0.0, leave: 10.0, misses: 0 }];
        let mut scratch = Vec::new();
        views.iter().for_each(|inside| carve(&mut spans, &mut scratch, inside, allowed));
        let mut crossings = Vec::new();
        append_crossings(&spans, &mut crossings);
        crossings
    }

    #[test]
    fn intersection_by_hand() {
        assert_eq!(crossings(&[&[1.0, 4.0, 6.0, 9.0], &[-5.0, 2.0, 3.0, 7.0]], 0), [1.0, 2.0, 3.0, 4.0, 6.0, 7.0]);
        assert_eq!(crossings(&[&[f64::NEG_INFINITY, 5.0], &[2.0, f64::INFINITY]], 0), [2.0, 5.0]);
        assert!(crossings(&[&[1.0, 2.0], &[2.0, 3.0]], 0).is_empty());
        assert!(crossings(&[&[]], 0).is_empty());
    }

    #[test]
    fn one_of_three_may_dissent() {
        let views: [&[f64]; 3] = [&[1.0, 5.0], &[2.0, 6.0], &[4.0, 8.0]];
        assert_eq!(crossings(&views, 0), [4.0, 5.0]);
        assert_eq!(crossings(&views, 1), [2.0, 6.0]);
        assert_eq!(crossings(&views, 2), [1.0, 8.0]);
        assert_eq!(crossings(&views, 3), [0.0, 10.0]);
    }

    #[test]
    fn identical_and_nearly_identical_crossings_leave_no_sliver() {
        assert_eq!(crossings(&[&[1.0, 5.0], &[1.0, 5.0]], 0), [1.0, 5.0]);
        assert_eq!(crossings(&[&[1.0, 3.0, 3.0 + 1e-12, 5.0]], 0), [1.0, 5.0]);
        assert!(crossings(&[&[1.0, 3.0], &[3.0 - 1e-12, 5.0]], 0).is_empty());
    }
}
