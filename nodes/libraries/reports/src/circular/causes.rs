//! The causes of circles, with what the scatter of the fit and the instruments leave open of them.

use iso230::breakdown::{Alias, Instrument as Errors, Needed, PlaneBreakdown, Row, RowKey, Unit};
use metrology::Axis;
use metrology::sample::TestPlane;
use metrology::squareness::{between, in_words};

use super::super::bars::{self, Bar};
use super::super::screen::Tile;
use super::super::section::{Drawing, Rows, Section, head, rounded, um};
use super::scale::Expansion;
use crate::evaluate::circle_reading::CircleReading;
use crate::evaluate::circles::{Instrument, plane_axes};

/// Coverage factor of what is printed.
const COVERAGE: f64 = 2.0;
/// Probability above which a row may be chance.
const BY_CHANCE: f64 = 0.01;
/// Most causes of the answer, and of the drawing.
const MOST_IN_ANSWER: usize = 3;
const MOST_CAUSES_DRAWN: usize = 8;
/// What a scatter lacks.
pub const SCATTER_ALONE: &str = "What the instruments themselves are off by is not in them.";

/// By what the recordings of one breakdown were read, and how well.
pub struct Read {
    readings: Vec<(TestPlane, CircleReading)>,
    /// One for each recording; none where that of any is not stated.
    errors: Vec<Errors>,
}

impl Read {
    /// In the order of the recordings.
    pub fn of(readings: impl Iterator<Item = (TestPlane, CircleReading)>) -> Self {
        let readings: Vec<(TestPlane, CircleReading)> = readings.collect();
        let errors: Option<Vec<Errors>> = readings.iter().map(|(_, one)| one.errors()).collect();
        Self {
            errors: errors.unwrap_or_default(),
            readings,
        }
    }

    /// For the breakdown.
    pub fn errors(&self) -> &[Errors] {
        &self.errors
    }

    fn is_stated(&self) -> bool {
        !self.errors.is_empty()
    }

    fn of_plane<'a>(
        &'a self,
        plane: &'a PlaneBreakdown,
    ) -> impl Iterator<Item = &'a CircleReading> {
        let readings = self.readings.iter();
        let own = readings.filter(|(of, _)| plane_axes(*of) == Some(plane.axes));
        own.map(|(_, reading)| reading)
    }

    /// What the uncertainties of a plane's causes are made of.
    fn in_words(&self, plane: &PlaneBreakdown) -> String {
        if !self.is_stated() {
            let why = self.of_plane(plane).find_map(|one| one.unstated);
            let why = why.unwrap_or("another circle has no uncertainty");
            return format!("± 2 s: scatter of the fit, {why}. {SCATTER_ALONE}");
        }
        let has = |instrument| self.of_plane(plane).any(|one| one.instrument == instrument);
        let mut parts = vec!["the scatter of the fit"];
        if has(Instrument::GridEncoder) {
            parts.push("certificate of the plate (scale of each axis, waves, steps)");
        }
        let is_square = self
            .of_plane(plane)
            .any(|one| one.plate_squareness_rad.is_some());
        if is_square {
            parts.push("its squareness");
        }
        if has(Instrument::Ballbar) {
            parts.push("reading of the ballbar");
        }
        parts.push("drift");
        let lacking = if has(Instrument::GridEncoder) && !is_square {
            " U of the squareness lacks that of the plate: the budget states no plate_squareness_urad."
        } else {
            ""
        };
        format!("U, k = 2: {}.{lacking}", parts.join(", "))
    }
}

/// One part for the causes of a plane; `greatest_mm`: the greatest G of its circles.
pub fn section(
    plane: &PlaneBreakdown,
    (state, greatest_mm): (&str, Option<f64>),
    expansion: &Expansion,
    read: &Read,
) -> Section {
    let [u, v] = plane.axes;
    let mut section = Section::new(format!("Causes in {u}{v}, {state}"));
    let greatest = um(greatest_mm.unwrap_or(plane.worst_circularity_mm));
    let ranked = beyond(plane);
    section.answer(answer(plane, &ranked, &greatest));
    section.tile = Some(tile(&ranked, [u, v], &greatest));
    section.drawings.extend(drawing(plane));
    let (lines, scale_at_20_degc) = expansion.state(plane);
    section.lines.extend(lines);
    section.lines.push(read.in_words(plane));
    let rows = plane.rows.iter().map(|row| {
        vec![
            row.name.clone(),
            with_unit(row.value, row.standard_uncertainty, row.unit),
            um(row.peak_to_peak_mm),
            format!("{:.1}", row.share_percent),
            signed(row.variance_share_percent),
            um(row.worst_circularity_without_mm),
        ]
    });
    let of_value = if read.is_stated() {
        "value ± U (k = 2)"
    } else {
        "value ± 2 s of the fit"
    };
    section.tables.push(Rows {
        head: head(&[
            "cause",
            of_value,
            "span / µm",
            "share / %",
            "part of the mean square / %",
            "G without / µm",
        ]),
        rows: rows.collect(),
        note: format!(
            "Span: greatest minus least deviation that the cause alone makes on one circle. G without: the greatest circular error that would be left, single outliers of the reader left out. {}{}{}",
            parts(plane.rows.iter().map(|row| (row.name.as_str(), row.variance_share_percent))),
            squareness(plane),
            needed(plane)
        ),
    });
    section.tables.extend(where_to_look(plane));
    section.figures = serde_json::json!({
        "test": section.title,
        "breakdown": plane,
        "instruments_are_in_the_uncertainties": read.is_stated(),
        "scale_at_20_degc": scale_at_20_degc,
    });
    section
}

/// The largest causes, the greatest G and the rest.
fn answer(plane: &PlaneBreakdown, ranked: &[&Row], greatest: &str) -> String {
    let largest: Vec<String> = { ranked.iter() }
        .take(MOST_IN_ANSWER)
        .map(|row| sized(row))
        .collect();
    let largest = match largest.as_slice() {
        [] => "No cause is beyond chance and its U".to_owned(),
        [one] => format!("Largest cause: {one}"),
        several => format!("Largest causes: {}", several.join(", ")),
    };
    format!(
        "{largest}; greatest circular error G of a sense {greatest} µm in {} recordings, of which no cause explains {:.2} µm (standard deviation).",
        plane.recordings.len(),
        plane.noise.residual_mm * 1e3
    )
}

/// Causes that are neither chance nor what the instrument may have made, the largest first.
fn beyond(plane: &PlaneBreakdown) -> Vec<&Row> {
    let mut rows: Vec<&Row> = plane.rows.iter().filter(|row| is_beyond(row)).collect();
    rows.sort_by(|a, b| b.peak_to_peak_mm.total_cmp(&a.peak_to_peak_mm));
    rows
}

fn is_beyond(row: &Row) -> bool {
    row.chance < BY_CHANCE && row.value.abs() > COVERAGE * row.standard_uncertainty
}

/// A cause with its value and U.
fn sized(row: &Row) -> String {
    let value = with_unit(row.value, row.standard_uncertainty, row.unit);
    format!("{} {value}", row.name)
}

/// The largest cause on the first screen.
fn tile(ranked: &[&Row], [u, v]: [Axis; 2], greatest: &str) -> Tile {
    let name = format!("largest cause in {u}{v}");
    let Some(row) = ranked.first() else {
        let more = format!("no cause is beyond chance and its U; G of a sense {greatest} µm");
        return Tile::new(&name, "none beyond U", more);
    };
    let next = ranked.get(1).map_or_else(String::new, |next| {
        format!("; next {}, {} µm", next.name, um(next.peak_to_peak_mm))
    });
    let more = format!(
        "makes {} µm alone, G is {greatest} µm{next}",
        um(row.peak_to_peak_mm)
    );
    Tile::new(&name, sized(row), more)
}

/// The causes by what each makes alone; `None` without any.
fn drawing(plane: &PlaneBreakdown) -> Option<Drawing> {
    let mut rows: Vec<&Row> = plane.rows.iter().collect();
    rows.sort_by(|a, b| b.peak_to_peak_mm.total_cmp(&a.peak_to_peak_mm));
    let bar = |row: &&Row| Bar {
        name: sized(row),
        size: row.peak_to_peak_mm * 1e3,
        is_beyond: is_beyond(row),
    };
    let bars: Vec<Bar> = rows.iter().take(MOST_CAUSES_DRAWN).map(bar).collect();
    (!bars.is_empty()).then(|| Drawing {
        svg: bars::svg("span that each cause makes alone / µm", &bars),
        caption: "Largest causes with U (k = 2). Faint: not beyond chance or U.".to_owned(),
    })
}

/// A part with one decimal, and no minus before a zero.
fn signed(percent: f64) -> String {
    let rounded = (percent * 10.0).round() / 10.0;
    format!("{:.1}", rounded + 0.0)
}

/// What the parts of the mean square (name, %) are; why one is below 0, where one is.
fn parts<'a>(rows: impl Iterator<Item = (&'a str, f64)>) -> String {
    const WORDS: &str = "Part of the mean square: the cause's own square and half of what it has in common with each other cause; with what no row explains they make 100 %.";
    let below = rows.filter(|(_, percent)| signed(*percent).starts_with('-'));
    let names: Vec<&str> = below.map(|(name, _)| name).collect();
    if names.is_empty() {
        format!("{WORDS} ")
    } else {
        format!(
            "{WORDS} Below 0 ({}): it cancels more of the other causes than it adds; without it the mean square would be greater. ",
            names.join(", ")
        )
    }
}

/// The sign of the squareness, where there is a row of it.
fn squareness(plane: &PlaneBreakdown) -> String {
    let [u, v] = plane.axes;
    let row = plane.row(&RowKey::Squareness);
    let words = row.and_then(|_| in_words(between(u, v)?));
    words.map_or_else(String::new, |words| format!("{words} "))
}

/// Where to look, for the causes that chance does not explain.
fn where_to_look(plane: &PlaneBreakdown) -> Option<Rows> {
    let (seen, not_seen): (Vec<&Row>, Vec<&Row>) =
        plane.rows.iter().partition(|row| row.chance < BY_CHANCE);
    // What the instrument may have made is no reason to look at the machine.
    let (seen, within): (Vec<&Row>, Vec<&Row>) = seen
        .into_iter()
        .partition(|row| row.value.abs() > COVERAGE * row.standard_uncertainty);
    let note = [
        ("Not beyond chance", not_seen),
        ("Not beyond its U", within),
    ]
    .into_iter()
    .filter(|(_, rows)| !rows.is_empty())
    .map(|(words, rows)| {
        let names: Vec<&str> = rows.iter().map(|row| row.name.as_str()).collect();
        format!("{words}: {}.", names.join(", "))
    })
    .collect::<Vec<_>>()
    .join(" ");
    (!seen.is_empty()).then(|| Rows {
        head: head(&["cause", "look at"]),
        rows: seen
            .iter()
            .map(|row| vec![row.name.clone(), row.cause.clone()])
            .collect(),
        note,
    })
}

fn needed(plane: &PlaneBreakdown) -> String {
    let tied = plane
        .rows
        .iter()
        .flat_map(|row| &row.aliases)
        .chain(&plane.unseen);
    let words: Vec<String> = tied.map(asks).collect();
    if words.is_empty() {
        "Every row is separated from the others.".to_owned()
    } else {
        words.join(" ")
    }
}

fn asks(alias: &Alias) -> String {
    let word = |needed: &Needed| match needed {
        Needed::OtherSense => "the other sense",
        Needed::OtherFeed => "another feed",
        Needed::OtherRadius => "another radius",
        Needed::OtherRadiusSameZero => "another radius under the same zero",
        Needed::FullCircle => "a full circle",
        Needed::CalibratedReference => "a calibrated reference length",
    };
    let ways = alias.needed.iter().map(|way| {
        let words: Vec<&str> = way.iter().map(word).collect();
        words.join(" and ")
    });
    format!(
        "{} needs {} to be separated.",
        alias.name,
        ways.collect::<Vec<_>>().join(", or by ")
    )
}

/// A value with its expanded uncertainty.
pub fn with_unit(value: f64, standard_uncertainty: f64, unit: Unit) -> String {
    let (factor, name) = match unit {
        Unit::Mm => (1e3, "µm"),
        Unit::MmPerMm => (1e6, "µm/m"),
        Unit::Rad => (1e6, "µrad"),
        Unit::S => (1e3, "ms"),
        Unit::S2 => (1e6, "ms²"),
        Unit::PerMm => (1e6, "µm/(m mm)"),
        Unit::MmPerS => (1e3, "µm/s"),
        Unit::Hz => (1.0, "Hz"),
        Unit::LobesPerTurn => (1.0, "per turn"),
    };
    let (value, u) = rounded(value * factor, COVERAGE * standard_uncertainty * factor);
    format!("{value} ± {u} {name}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_below_0_has_its_reason_and_a_zero_no_minus() {
        for (percent, cell) in [
            (-0.04, "0.0"),
            (-0.4, "-0.4"),
            (12.34, "12.3"),
            (0.0, "0.0"),
        ] {
            assert_eq!(signed(percent), cell);
        }
        let plain = parts([("squareness", 100.0), ("drift", -0.04)].into_iter());
        assert!(plain.ends_with("make 100 %. "), "{plain}");
        let below = parts([("squareness", 100.4), ("scaling mismatch", -0.4)].into_iter());
        assert!(
            below.contains("Below 0 (scaling mismatch): it cancels"),
            "{below}"
        );
    }
}
