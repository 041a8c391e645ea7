//! Positions that were measured, beside deviations: a deviation is the measured position less the target, and a table
//! whose columns say otherwise has the sign, the unit or a row of one of them wrong.

use anyhow::{Result, bail};
use metrology::yaml::shown;

use super::map::{Map, Test, What, units};
use super::recognise::{Role, role_of_name};
use super::stated;
use super::table::{Row, number_of};
use super::vocabulary::{is_correction, is_reversed};

/// Lines of cells with their numbers.
type Lines = [(u64, Vec<String>)];

/// Share of the span of the targets within which measured positions lie beside them; other numbers are no positions.
const BESIDE: f64 = 0.05;
/// Least number of targets whose even spacing is seen.
const LEAST_EVEN: usize = 4;
/// Rounding of a table that was computed with 64 bits, in units of targets.
const ROUNDING: f64 = 1e-9;

/// A column of numbers that is compared with the deviations.
struct Comparison<'t> {
    /// Its place among the cells, and its name.
    place: usize,
    name: &'t str,
    /// Units of targets for one of its numbers.
    size: f64,
    /// Numbers differ by so much from rounding alone, in units of targets.
    rounding: f64,
    /// Step of the last decimal of the targets.
    target_step: f64,
}

/// A row with all three.
struct Triple {
    line: u64,
    target: f64,
    measured: f64,
    /// In units of targets.
    deviation: f64,
}

/// Compares deviations with a column of measured positions that the map does not name; a remark where they differ by one
/// number everywhere. `rows` are those that were read.
///
/// # Errors
/// With line and both values of the first row where a deviation is not the measured position less the target.
pub fn check(map: &Map, head: &[String], lines: &Lines, rows: &[Row]) -> Result<Option<String>> {
    let Test::Positioning { axis, .. } = &map.test else {
        return Ok(None);
    };
    let columns = map.test.columns();
    let at = |is: fn(What) -> bool| columns.iter().position(|column| is(column.what));
    let target = at(|what| matches!(what, What::Place(_)));
    let read = at(|what| matches!(what, What::Deviation(_)));
    let (Some(target), Some(read)) = (target, read) else {
        return Ok(None);
    };
    if !map.test.passes().is_empty() {
        return Ok(None);
    }
    let [target_name, read_name] = [target, read].map(|k| columns[k].name);
    let units = units(*axis);
    let size = units.deviation_in_targets();
    for (place, name) in head.iter().enumerate() {
        let is_named = columns.iter().any(|column| column.name == name);
        let is_other = is_named || is_correction(name) || is_reversed(name);
        if is_other || role_of_name(name) != Some(Role::Measured) {
            continue;
        }
        let Some(unit) = unit_of(map, name, target_name) else {
            continue;
        };
        if unit.kind() != units.of_cells[0].kind() {
            continue;
        }
        let step = |name: &str, size: f64| {
            let k = head.iter().position(|other| other == name);
            k.map_or(0.0, |k| least_step(lines, k, map.decimal) * size)
        };
        let of = |name: &str, own: super::units::Unit| {
            let stated = map.units.get(name).copied().unwrap_or(own);
            stated.size() / units.of_cells[0].size()
        };
        let [place_unit, deviation_unit] = units.of_cells;
        let unit_size = unit.size() / units.of_cells[0].size();
        let compared = Comparison {
            place,
            name,
            size: unit_size,
            rounding: ROUNDING
                + step(name, unit_size)
                + step(read_name, of(read_name, deviation_unit)),
            target_step: step(target_name, of(target_name, place_unit)),
        };
        let triples = triples(&compared, lines, rows, ([target, read], size, map.decimal));
        if let Some(remark) = compare(&compared, &triples, (read_name, units.turn, units.target))? {
            return Ok(Some(remark));
        }
    }
    Ok(None)
}

/// The unit of a column of positions: stated in the map or its name; otherwise that of the targets.
fn unit_of(map: &Map, name: &str, target: &str) -> Option<super::units::Unit> {
    let Test::Positioning { axis, .. } = &map.test else {
        return None;
    };
    let stated = |name: &str| map.units.get(name).copied();
    let of_target = || stated(target).unwrap_or(units(*axis).of_cells[0]);
    match stated::of(name) {
        _ if stated(name).is_some() => stated(name),
        stated::Stated::Unit(unit, _) => Some(unit),
        stated::Stated::Nothing => Some(of_target()),
        stated::Stated::Unknown(_) => None,
    }
}

/// The step of the last decimal that any cell of a column has.
fn least_step(lines: &Lines, place: usize, decimal: char) -> f64 {
    let cells = lines.iter().filter_map(|(_, cells)| cells.get(place));
    let numbers = cells.filter(|cell| number_of(cell, decimal).is_some());
    let decimals = numbers.map(|cell| match cell.split_once(decimal) {
        Some(_) if cell.contains(['e', 'E']) => i32::from(u8::MAX),
        Some((_, decimals)) => decimals.chars().filter(char::is_ascii_digit).count() as i32,
        None => 0,
    });
    decimals.max().map_or(0.0, |most| 10.0_f64.powi(-most))
}

fn triples(
    compared: &Comparison<'_>,
    lines: &Lines,
    rows: &[Row],
    ([target, read], size, decimal): ([usize; 2], f64, char),
) -> Vec<Triple> {
    let mut own = rows.iter().peekable();
    let mut all = vec![];
    for (line, cells) in lines {
        let Some(row) = own.next_if(|row| row.line == *line) else {
            continue;
        };
        let cell = cells.get(compared.place);
        let measured = cell.and_then(|cell| number_of(cell, decimal));
        let deviation = row.cells[read] * size;
        if let Some(measured) = measured.filter(|_| deviation.is_finite()) {
            all.push(Triple {
                line: *line,
                target: row.cells[target],
                measured: measured * compared.size,
                deviation,
            });
        }
    }
    all
}

/// Whether all differences come from targets that are shown with fewer decimals than they have: at each target they are
/// one, whatever the deviations are.
fn is_of_targets(
    off: &dyn Fn(&Triple) -> f64,
    triples: &[Triple],
    compared: &Comparison<'_>,
) -> bool {
    let mut sorted: Vec<&Triple> = triples.iter().collect();
    sorted.sort_by(|a, b| a.target.total_cmp(&b.target));
    let repeats = || {
        let twos = sorted.windows(2).map(|two| (two[0], two[1]));
        twos.filter(|(a, b)| a.target.total_cmp(&b.target).is_eq())
    };
    let is_above = |a: f64, b: f64| (a - b).abs() > compared.rounding;
    let half_step = 0.5 * compared.target_step + compared.rounding;
    let has_other = repeats().any(|(a, b)| is_above(a.deviation, b.deviation));
    has_other
        && triples.iter().all(|row| off(row).abs() <= half_step)
        && !repeats().any(|(a, b)| is_above(off(a), off(b)))
}

/// A remark on targets of a single run that are shown with fewer decimals than they have. With no repeat the even spacing shows
/// it: two at least agree with what was measured, the others within half of their last decimal, and measured less deviation
/// is spaced evenly.
fn of_even_targets(
    off: &dyn Fn(&Triple) -> f64,
    triples: &[Triple],
    (compared, unit): (&Comparison<'_>, &str),
) -> Option<String> {
    let mut sorted: Vec<&Triple> = triples.iter().collect();
    sorted.sort_by(|a, b| a.target.total_cmp(&b.target));
    let mut twos = sorted.windows(2);
    let has_repeat = twos.any(|two| two[0].target.total_cmp(&two[1].target).is_eq());
    if has_repeat || sorted.len() < LEAST_EVEN {
        return None;
    }
    let exact: Vec<f64> = sorted
        .into_iter()
        .map(|row| row.target + off(row))
        .collect();
    let (first, last) = (*exact.first()?, *exact.last()?);
    let spacing = (last - first) / (exact.len() - 1) as f64;
    let mut places = exact.iter().enumerate();
    let is_even = places.all(|(k, place)| {
        let wanted = first + spacing * k as f64;
        (place - wanted).abs() <= 2.0 * compared.rounding
    });
    let offs: Vec<f64> = triples.iter().map(|row| off(row).abs()).collect();
    let n_equal = offs.iter().filter(|off| **off <= compared.rounding).count();
    let most = offs.iter().copied().fold(0.0, f64::max);
    let is_within = most <= 0.5 * compared.target_step + compared.rounding;
    (is_even && n_equal >= 2 && is_within).then(|| {
        format!(
            "column \"{}\": less the deviation it is spaced evenly and up to {} {unit} beside the targets: they have fewer decimals than the \
             test had, and the deviations are taken",
            shown(compared.name),
            rounded(most)
        )
    })
}

fn compare(
    compared: &Comparison<'_>,
    triples: &[Triple],
    (read_name, turn, unit): (&str, Option<f64>, &str),
) -> Result<Option<String>> {
    let difference = |row: &Triple| {
        let difference = row.measured - row.target;
        turn.map_or(difference, |turn| {
            difference - turn * (difference / turn).round()
        })
    };
    let targets = triples.iter().map(|row| row.target);
    let [least, most] = [
        targets.clone().fold(f64::INFINITY, f64::min),
        targets.fold(f64::NEG_INFINITY, f64::max),
    ];
    let is_beside = |row: &&Triple| difference(row).abs() <= BESIDE * (most - least);
    let n_beside = triples.iter().filter(is_beside).count();
    if triples.is_empty() || most <= least || 2 * n_beside <= triples.len() {
        return Ok(None);
    }
    let off = |row: &Triple| difference(row) - row.deviation;
    let mut offs: Vec<f64> = triples.iter().map(off).collect();
    offs.sort_by(f64::total_cmp);
    let middle = offs[offs.len() / 2];
    let tolerance = compared.rounding;
    let is_one = offs.iter().all(|off| (off - middle).abs() <= tolerance);
    let differing = triples.iter().find(|row| off(row).abs() > tolerance);
    let Some(row) = differing.filter(|_| !is_of_targets(&off, triples, compared)) else {
        return Ok(None);
    };
    let name = shown(compared.name);
    if is_one && triples.len() > 1 {
        return Ok(Some(format!(
            "column \"{name}\": less the target it is {} {unit} more than \"{}\" in every row: its zero is another, and the deviations are taken",
            rounded(middle),
            shown(read_name)
        )));
    }
    if let Some(remark) = of_even_targets(&off, triples, (compared, unit)) {
        return Ok(Some(remark));
    }
    let is_turned = triples
        .iter()
        .all(|row| (difference(row) + row.deviation).abs() <= tolerance);
    let turned = if is_turned {
        ", the other sign in every row: a deviation is the measured position less the target"
    } else {
        ""
    };
    bail!(
        "line {}, column \"{}\": the deviation is {} {unit}, and \"{name}\" less the target is {} {unit}{turned}: correct one of the \
         columns (or its unit), or rename \"{name}\" where it holds something else",
        row.line,
        shown(read_name),
        rounded(row.deviation),
        rounded(difference(row))
    );
}

/// A length or an angle with its last decimal that matters.
fn rounded(value: f64) -> String {
    format!("{value:.6}")
}

#[cfg(test)]
mod tests {
    use super::super::sheet::Sheet;
    use super::super::table::Table;
    use super::*;

    const TARGETS: [f64; 5] = [0.0, 50.1, 100.2, 149.7, 200.4];
    const DEVIATIONS_UM: [f64; 5] = [0.16, -0.74, -1.95, -3.08, -4.24];

    /// What is remarked on a table of targets, deviations and another column, by keys of the map.
    fn said(keys: &str, name: &str, cell: impl Fn(f64, f64) -> String) -> (bool, String) {
        let test = "axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, target_mm: t, deviation_um: d";
        let map = format!("start_s: 0\n{keys}test:\n  positioning: {{{test}}}\n");
        let map: Map = serde_saphyr::from_str(&map).expect("a map");
        let rows = TARGETS.iter().zip(DEVIATIONS_UM);
        let rows = rows.map(|(t, d)| format!("{t},{d},{}\n", cell(*t, d)));
        let text = format!("t,d,{name}\n{}", rows.collect::<String>());
        let sheet = Sheet::of_text(&text, ',').expect("rows");
        match Table::of(&sheet, &map, &[None, None]) {
            Ok(table) => (true, table.left_out.join("\n")),
            Err(error) => (false, format!("{error:#}")),
        }
    }

    #[test]
    fn positions_that_contradict_the_deviations_are_refused_with_line_and_both_values() {
        let turned = |t: f64, d: f64| format!("{:.5}", t - 1e-3 * d);
        for name in [
            "measured_mm",
            "actual",
            "Istwert [mm]",
            "Messwert",
            "laser reading mm",
        ] {
            let (is_taken, said) = said("", name, turned);
            assert!(!is_taken, "{name}");
            for words in [
                "line 2, column \"d\": the deviation is 0.000160 mm",
                "less the target is -0.000160 mm, the other sign in every row",
                "rename",
            ] {
                assert!(said.contains(words), "{name}: {words}: {said}");
            }
        }
        for (keys, name, cell) in [
            // A unit that is wrong, a row that is wrong, and an error that grows with the target.
            (
                "",
                "measured_mm",
                Box::new(|t: f64, d: f64| format!("{:.6}", t + d))
                    as Box<dyn Fn(f64, f64) -> String>,
            ),
            (
                "",
                "measured_mm",
                Box::new(|t, d| format!("{:.6}", t + 1e-3 * if t > 149.0 { 2.0 * d } else { d })),
            ),
            (
                "",
                "measured_mm",
                Box::new(|t, d| format!("{:.6}", t + 1e-3 * d + 1e-4 * t)),
            ),
            (
                "",
                "measured_um",
                Box::new(|t, d| format!("{:.3}", 1e3 * t - d)),
            ),
            (
                "units: {measured: inch}\n",
                "measured",
                Box::new(|t, d| format!("{:.8}", (t - 1e-3 * d) / 25.4)),
            ),
        ] {
            let (is_taken, said) = said(keys, name, cell);
            assert!(!is_taken, "{name}: {said}");
        }
    }

    #[test]
    fn positions_that_agree_and_columns_of_other_numbers_do_no_harm() {
        for (keys, name, cell) in [
            (
                "",
                "measured_mm",
                Box::new(|t: f64, d: f64| format!("{:.5}", t + 1e-3 * d))
                    as Box<dyn Fn(f64, f64) -> String>,
            ),
            // A display of 1 µm, and another zero.
            (
                "",
                "measured_mm",
                Box::new(|t, d| format!("{:.3}", t + 1e-3 * d)),
            ),
            (
                "",
                "measured_mm",
                Box::new(|t, d| format!("{:.6}", t + 1e-3 * d + 0.5)),
            ),
            (
                "",
                "actual um",
                Box::new(|t, d| format!("{:.2}", 1e3 * t + d)),
            ),
            (
                "units: {measured: inch}\n",
                "measured",
                Box::new(|t, d| format!("{:.9}", (t + 1e-3 * d) / 25.4)),
            ),
            // No positions: numbers of readings, powers, temperatures.
            (
                "",
                "reading",
                Box::new(|t, _| format!("{:.0}", t / 50.0 + 1.0)),
            ),
            ("", "laser power", Box::new(|_, _| "81.5".to_owned())),
            (
                "",
                "measured temperature [degC]",
                Box::new(|_, _| "20.5".to_owned()),
            ),
            ("", "measured_mm", Box::new(|_, _| String::new())),
        ] {
            let (is_taken, said) = said(keys, name, cell);
            assert!(is_taken, "{name}: {said}");
            let is_offset = said.contains("in every row: its zero is another");
            assert!(!is_offset || said.contains("0.500000 mm more"), "{said}");
        }
    }

    #[test]
    fn targets_that_are_shown_with_fewer_decimals_are_no_contradiction() {
        let map: Map = serde_saphyr::from_str(
            "start_s: 0\ntest:\n  positioning: {axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, run: n, target_mm: t, deviation_um: d}\n",
        )
        .expect("a map");
        for (sign, is_taken) in [(1.0, true), (-1.0, false)] {
            let mut text = "n,t,d,measured_mm\n".to_owned();
            for (run, k) in (1..=3).flat_map(|run| (0..4).map(move |k| (run, k))) {
                let target = 100.0 / 3.0 * f64::from(k);
                let deviation = 0.5 * f64::from(run) + 0.3 * f64::from(k);
                let measured = target + sign * 1e-3 * deviation;
                text.push_str(&format!("{run},{target:.2},{deviation:.2},{measured:.5}\n"));
            }
            let sheet = Sheet::of_text(&text, ',').expect("rows");
            let table = Table::of(&sheet, &map, &[None, None, None]);
            assert_eq!(table.is_ok(), is_taken, "{sign}");
        }
    }

    #[test]
    fn evenly_spaced_targets_of_a_single_run_may_be_rounded() {
        let map: Map = serde_saphyr::from_str(
            "start_s: 0\ntest:\n  positioning: {axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, target_mm: t, deviation_um: d}\n",
        )
        .expect("a map");
        // Spacing of the targets, sign of the deviations in the measured positions, µm more in the third row.
        for (spacing, sign, more_um, is_taken) in [
            (100.0 / 3.0, 1.0, 0.0, true),
            (100.0 / 7.0, 1.0, 0.0, true),
            (100.0 / 3.0, -1.0, 0.0, false),
            (100.0 / 3.0, 1.0, 2.0, false),
            (50.0, 1.0, 2.0, false),
            (50.0, -1.0, 0.0, false),
        ] {
            let mut text = "t,d,measured_mm\n".to_owned();
            for k in 0..8 {
                let target = spacing * f64::from(k);
                let deviation = 0.5 + 0.3 * f64::from(k);
                let more = if k == 2 { more_um } else { 0.0 };
                let measured = target + 1e-3 * (sign * deviation + more);
                text.push_str(&format!("{target:.2},{deviation:.2},{measured:.5}\n"));
            }
            let sheet = Sheet::of_text(&text, ',').expect("rows");
            let table = Table::of(&sheet, &map, &[None, None]);
            let case = format!("{spacing} {sign} {more_um}");
            assert_eq!(table.is_ok(), is_taken, "{case}");
            if let Ok(table) = table {
                let mut lines = table.left_out.iter();
                assert!(
                    lines.any(|line| line.contains("is spaced evenly")),
                    "{case}"
                );
            }
        }
    }
}
