//! The height between the two blocks at the ends of the table's diagonal.
//!
//! The published method sets it to 150 to 200 mm: it is the span over which the slope of Z is measured. Below it that
//! slope is uncertain (its uncertainty grows as 1/height), above it the blocks' posts grow and bend with heat as the
//! machine does. Of several diagonals of one length, as four blocks have, the one nearest to the range counts.
//!
//! # References
//! CN patent application on on-machine modelling of a whole machine's thermal error, published 2024-01-16, claim 3.

use nalgebra::Vector3;

use crate::diagnostic::Diagnostic;

/// Wanted height, mm.
pub const WANTED_MM: [f64; 2] = [150.0, 200.0];
/// Diagonals that differ by less have one length, mm.
const ONE_LENGTH_MM: f64 = 1.0;

/// What to say of the blocks' corners (name and place, mm); `None` where the height is as wanted, or where there are
/// no two blocks.
#[must_use]
pub fn remark(corners: &[(&str, Vector3<f64>)]) -> Option<Diagnostic> {
    let (first, second) = diagonal(corners)?;
    let height_mm = height(first, second);
    (outside_mm(height_mm) > 0.0).then(|| Diagnostic::BlockHeights {
        first: first.0.to_owned(),
        second: second.0.to_owned(),
        height_mm,
    })
}

type Corner<'a> = (&'a str, Vector3<f64>);

fn height(first: &Corner<'_>, second: &Corner<'_>) -> f64 {
    (first.1.z - second.1.z).abs()
}

fn outside_mm(height_mm: f64) -> f64 {
    (WANTED_MM[0] - height_mm)
        .max(height_mm - WANTED_MM[1])
        .max(0.0)
}

/// The two blocks that are farthest apart on the table.
fn diagonal<'a>(corners: &'a [Corner<'a>]) -> Option<(&'a Corner<'a>, &'a Corner<'a>)> {
    let pairs = || {
        let firsts = corners.iter().enumerate();
        firsts.flat_map(|(k, first)| corners[k + 1..].iter().map(move |second| (first, second)))
    };
    let length = |(first, second): &(&Corner<'_>, &Corner<'_>)| (first.1 - second.1).xy().norm();
    let longest_mm = pairs().map(|pair| length(&pair)).fold(0.0, f64::max);
    pairs()
        .filter(|pair| length(pair) > longest_mm - ONE_LENGTH_MM)
        .min_by(|p, q| outside_mm(height(p.0, p.1)).total_cmp(&outside_mm(height(q.0, q.1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(heights_mm: &[f64]) -> Option<String> {
        let places = [
            (-220.0, -180.0),
            (220.0, 180.0),
            (220.0, -180.0),
            (-220.0, 180.0),
        ];
        let names = ["a", "b", "c", "d"];
        let corners: Vec<Corner<'_>> = names
            .iter()
            .zip(places)
            .zip(heights_mm)
            .map(|((name, (x, y)), z)| (*name, Vector3::new(x, y, *z)))
            .collect();
        remark(&corners).map(|remark| remark.to_string())
    }

    #[test]
    fn a_height_from_150_to_200_mm_needs_no_remark() {
        for height_mm in [150.0, 180.0, 200.0] {
            assert_eq!(said(&[20.0, 20.0 + height_mm]), None, "{height_mm}");
        }
        assert_eq!(said(&[20.0]), None);
        // The second diagonal of four blocks is level, the first is as wanted.
        assert_eq!(said(&[20.0, 200.0, 20.0, 20.0]), None);
    }

    #[test]
    fn a_height_outside_is_remarked_with_both_blocks() {
        let words = said(&[20.0, 110.0]).unwrap();
        assert!(
            words.starts_with(
                "blocks \"a\" and \"b\" at the ends of the diagonal differ by 90 mm in height"
            ),
            "{words}"
        );
        assert!(words.contains("150 to 200 mm"), "{words}");
        assert!(said(&[220.0, 19.9]).unwrap().contains("200.1 mm"));
        assert!(
            said(&[20.0, 20.0, 20.0, 60.0])
                .unwrap()
                .contains("\"c\" and \"d\"")
        );
    }
}
