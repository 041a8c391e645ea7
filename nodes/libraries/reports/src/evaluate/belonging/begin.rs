//! What begin and end of a run may state.

use std::fmt::Debug;

use metrology::number::number;
use metrology::sample::{FARTHEST_FROM_NOMINAL, Sense, TestKind, TestPlane, TestSegment};
use nalgebra::Vector3;

/// Lengths of begin and end that differ by less are one, mm and mm/s.
const SAME_NUMBER: f64 = 1e-6;
/// Greatest feed of a machine tool, mm/s.
const GREATEST_FEED_MM_S: f64 = 10_000.0;

/// Why a begin cannot be that of a test of its kind; `None`: it can.
pub(super) fn wrong_begin(segment: &TestSegment) -> Option<String> {
    let ranges = [
        ("radius_m", segment.radius_mm, FARTHEST_FROM_NOMINAL),
        ("feed_m_s", segment.feed_mm_s, GREATEST_FEED_MM_S),
    ];
    for (name, value_mm, greatest_mm) in ranges {
        if !(0.0..=greatest_mm).contains(&value_mm) {
            let [value, greatest] = [value_mm, greatest_mm].map(|mm| number(mm * 1e-3));
            return Some(format!("{name} = {value}: must be from 0 to {greatest}"));
        }
    }
    if segment.kind != TestKind::Circle {
        return None;
    }
    let is_moving = segment.stations == 0;
    let flaws = [
        ("radius_m = 0: must be above 0", segment.radius_mm <= 0.0),
        (
            "plane = 0: must be 1 to 3",
            segment.plane == TestPlane::None,
        ),
        (
            "sense = 0: must be 1 or 2",
            is_moving && segment.sense == Sense::None,
        ),
    ];
    let first = flaws.into_iter().find(|(_, is_wrong)| *is_wrong);
    first.map(|(words, _)| format!("{words} for a circle"))
}

/// What an end states otherwise than its begin; `None`: nothing. What it does not state contradicts nothing.
pub(super) fn contradiction(begin: &TestSegment, end: &TestSegment) -> Option<String> {
    let lengths = [
        ("radius_m", begin.radius_mm, end.radius_mm),
        ("feed_m_s", begin.feed_mm_s, end.feed_mm_s),
    ];
    for (name, first, last) in lengths {
        if last.abs() > SAME_NUMBER && (last - first).abs() > SAME_NUMBER {
            let [first, last] = [first, last].map(|mm| number(mm * 1e-3));
            return Some(format!(
                "{name} = {first} at its begin and {last} at its end"
            ));
        }
    }
    let names = [
        ("plane", begin.plane as u8, end.plane as u8),
        ("sense", begin.sense as u8, end.sense as u8),
    ];
    let differs = names
        .into_iter()
        .find(|(_, first, last)| *last != 0 && first != last);
    let in_words = |name: &str, first: &dyn Debug, last: &dyn Debug| {
        format!("{name} = {first:?} at its begin and {last:?} at its end")
    };
    differs
        .map(|(name, first, last)| in_words(name, &first, &last))
        .or_else(|| {
            // Its number is 0, as that of a kind that is not stated.
            let is_stated = end.kind != TestKind::Latency || states_circle(end);
            (is_stated && end.kind != begin.kind).then(|| in_words("kind", &begin.kind, &end.kind))
        })
        .or_else(|| of_whole(begin, end))
}

/// Whether an end states what a circle has alone: then its kind is stated as well.
fn states_circle(end: &TestSegment) -> bool {
    end.radius_mm.abs() > SAME_NUMBER && end.plane != TestPlane::None
}

/// The other fields; one that is zero is not stated.
fn of_whole(begin: &TestSegment, end: &TestSegment) -> Option<String> {
    let places = [
        ("centre", begin.centre_mm, end.centre_mm),
        ("tool_offset", begin.tool_offset_mm, end.tool_offset_mm),
    ];
    let in_m = |mm: Vector3<f64>| {
        let all = mm.iter().map(|mm| number(mm * 1e-3));
        all.collect::<Vec<_>>().join(" ")
    };
    let is_other = |first: Vector3<f64>, last: Vector3<f64>| {
        last.amax() > SAME_NUMBER && (last - first).amax() > SAME_NUMBER
    };
    let mut places = places.into_iter();
    let place = places.find(|(_, first, last)| is_other(*first, *last));
    let numbers = [
        ("stations", begin.stations, end.stations),
        ("zero_id", begin.zero_id, end.zero_id),
        ("setup_id", begin.setup_id, end.setup_id),
    ];
    let mut numbers = numbers.into_iter();
    let other = numbers.find(|(_, first, last)| *last != 0 && first != last);
    let place = place.map(|(name, first, last)| (name, in_m(first), in_m(last)));
    let other = other.map(|(name, first, last)| (name, first.to_string(), last.to_string()));
    let differs = place.or(other);
    differs
        .map(|(name, first, last)| format!("{name} = {first} at its begin and {last} at its end"))
}

#[cfg(test)]
mod tests {
    use metrology::stamp::Stamp;

    use super::*;

    fn circle() -> TestSegment {
        TestSegment {
            plane: TestPlane::Xy,
            radius_mm: 100.0,
            feed_mm_s: 16.0,
            sense: Sense::Clockwise,
            ..TestSegment::of_kind(TestKind::Circle, 2, Stamp::from_nanos(1))
        }
    }

    #[test]
    fn a_begin_that_no_test_has_is_refused_by_its_field() {
        type Change = fn(&mut TestSegment);
        let cases: [(Change, &str); 6] = [
            (
                |it| it.radius_mm = 0.0,
                "radius_m = 0: must be above 0 for a circle",
            ),
            (
                |it| it.radius_mm = -100.0,
                "radius_m = -0.1: must be from 0 to 10",
            ),
            (
                |it| it.feed_mm_s = -1000.0,
                "feed_m_s = -1: must be from 0 to 10",
            ),
            (
                |it| it.feed_mm_s = 2e4,
                "feed_m_s = 20: must be from 0 to 10",
            ),
            (
                |it| it.plane = TestPlane::None,
                "plane = 0: must be 1 to 3 for a circle",
            ),
            (
                |it| it.sense = Sense::None,
                "sense = 0: must be 1 or 2 for a circle",
            ),
        ];
        assert_eq!(wrong_begin(&circle()), None);
        for (change, words) in cases {
            let mut begin = circle();
            change(&mut begin);
            assert_eq!(wrong_begin(&begin).as_deref(), Some(words));
        }
        // With stops it goes to each station, whatever the sense.
        let mut stops = circle();
        (stops.stations, stops.sense) = (72, Sense::None);
        assert_eq!(wrong_begin(&stops), None);
    }

    #[test]
    fn an_end_contradicts_by_what_it_states_alone() {
        let begin = circle();
        assert_eq!(contradiction(&begin, &begin), None);
        let bare = TestSegment::of_kind(TestKind::Circle, 2, Stamp::from_nanos(9));
        assert_eq!(contradiction(&begin, &bare), None);
        let mut other = circle();
        other.radius_mm = 50.0;
        let words = "radius_m = 0.1 at its begin and 0.05 at its end";
        assert_eq!(contradiction(&begin, &other).as_deref(), Some(words));
        let mut other = circle();
        other.plane = TestPlane::Zx;
        let words = "plane = 1 at its begin and 3 at its end";
        assert_eq!(contradiction(&begin, &other).as_deref(), Some(words));
        type Change = fn(&mut TestSegment);
        let cases: [(Change, &str); 6] = [
            (
                |it| it.kind = TestKind::Latency,
                "kind = Circle at its begin and Latency at its end",
            ),
            (
                |it| it.centre_mm.x = 50.0,
                "centre = 0 0 0 at its begin and 0.05 0 0 at its end",
            ),
            (
                |it| it.tool_offset_mm.z = 100.0,
                "tool_offset = 0 0 0 at its begin and 0 0 0.1 at its end",
            ),
            (
                |it| it.stations = 36,
                "stations = 0 at its begin and 36 at its end",
            ),
            (|it| it.zero_id += 1, "zero_id = "),
            (|it| it.setup_id += 1, "setup_id = "),
        ];
        for (change, words) in cases {
            let mut other = circle();
            change(&mut other);
            let said = contradiction(&begin, &other).unwrap_or_default();
            assert!(said.starts_with(words), "{said}");
            // An end that states nothing of it contradicts nothing.
            let mut bare = TestSegment::of_kind(TestKind::Circle, 2, Stamp::from_nanos(9));
            bare.completed = true;
            assert_eq!(
                contradiction(&other, &bare).is_some(),
                other.kind != TestKind::Circle
            );
        }
    }
}
