//! Columns that no key of a map names and that say what the map states: the axis, the plane and the sense of circles.
//!
//! They are known by their names, and by cells of which most are such words. A row that says something else than the map is
//! of another test.

use std::collections::BTreeMap;
use std::fmt::Display;

use anyhow::{Result, bail};
use metrology::Axis;
use metrology::yaml::shown;

use super::map::{Map, Plane, Test};
use super::parted;
use super::table::Row;

/// Lines of cells with their numbers.
type Lines = [(u64, Vec<String>)];

const AXIS_NAMES: &[&str] = &["axis", "achse", "axe"];
const PLANE_NAMES: &[&str] = &["plane", "ebene"];
const SENSE_NAMES: &[&str] = &[
    "sense",
    "direction",
    "dir",
    "drehsinn",
    "richtung",
    "rotation",
    "way",
];

/// The first axis in a column, with the column.
pub fn axis(head: &[String], lines: &Lines) -> Option<(String, Axis)> {
    first(head, lines, AXIS_NAMES, axis_of)
}

/// The first plane in a column, with the column.
pub fn plane(head: &[String], lines: &Lines) -> Option<(String, Plane)> {
    first(head, lines, PLANE_NAMES, plane_of)
}

/// What is wrong with a column of axes or planes that names no axis or plane.
pub fn odd(head: &[String], lines: &Lines) -> Option<String> {
    let of_planes = || {
        odd_cell(head, lines, PLANE_NAMES, |cell| plane_of(cell).is_some()).map(|odd| {
            format!("{odd}: must be XY, YZ or ZX; XZ is ZX seen from the other side: write ZX and turn the sense round")
        })
    };
    let of_axes = || {
        odd_cell(head, lines, AXIS_NAMES, |cell| axis_of(cell).is_some()).map(|odd| {
            format!("{odd}: must be X, Y, Z, A, B or C: correct it, or rename the column where it says something else")
        })
    };
    of_planes().or_else(of_axes)
}

/// The first cell of a column of this name alone that says nothing, where hardly one does.
fn odd_cell(
    head: &[String],
    lines: &Lines,
    names: &[&str],
    says: fn(&str) -> bool,
) -> Option<String> {
    let is_named = |name: &&String| names.contains(&name.trim().to_lowercase().as_str());
    let k = head.iter().position(|name| is_named(&name))?;
    let (n, n_said) = cells(lines, k).fold((0_usize, 0_usize), |(n, n_said), (_, cell)| {
        (n + 1, n_said + usize::from(says(cell)))
    });
    let (line, cell) = cells(lines, k).find(|(_, cell)| !says(cell))?;
    (2 * n_said <= n).then(|| {
        format!(
            "line {line}, column \"{}\": \"{}\"",
            shown(&head[k]),
            shown(cell)
        )
    })
}

/// Refuses rows of another axis, plane or sense than that of the map. `rows` are those that were read.
///
/// # Errors
/// With line, column and word, and what to do.
pub fn check(map: &Map, head: &[String], lines: &Lines, rows: &[Row]) -> Result<()> {
    let own = map.test.columns();
    let is_open = |name: &str| own.iter().all(|column| column.name != name);
    let open = |k: &usize| head.get(*k).is_some_and(|name| is_open(name));
    match &map.test {
        Test::Touches { .. } => return Ok(()),
        Test::Positioning { axis, .. } | Test::Log { axis, .. } => {
            let place = place(head, lines, AXIS_NAMES, axis_of).filter(open);
            place.map_or(Ok(()), |k| same((head, lines), k, axis_of, ("axis", *axis)))
        }
        Test::Circle { plane, .. } => {
            let at = place(head, lines, PLANE_NAMES, plane_of).filter(open);
            if let Some(k) = at {
                same((head, lines), k, plane_of, ("plane", *plane))?;
            }
            let at = place(head, lines, SENSE_NAMES, sense_of).filter(open);
            at.map_or(Ok(()), |k| sense((head, lines), k, rows))
        }
    }?;
    parted::check(map, head, lines, rows)
}

/// The columns that no key of the map names.
pub fn unnamed(head: &[String], places: &[usize], dates: Option<usize>) -> Vec<String> {
    let others = head.iter().enumerate();
    let others = others.filter(|(place, name)| !places.contains(place) && !name.is_empty());
    others
        .map(|(place, name)| match dates {
            Some(dates) if dates == place => {
                format!("column \"{name}\": its dates stand before the times of their rows")
            }
            _ => format!("column \"{name}\": the map does not name it"),
        })
        .collect()
}

fn axis_of(cell: &str) -> Option<Axis> {
    let upper = cell.to_uppercase();
    let words = upper.split(|letter: char| !letter.is_alphanumeric());
    let mut words = words.filter(|word| !word.is_empty() && !matches!(*word, "AXIS" | "ACHSE"));
    let word = words.next().filter(|word| word.len() == 1)?;
    word.parse().ok().filter(|_| words.next().is_none())
}

/// The plane that a word names.
pub fn plane_of(cell: &str) -> Option<Plane> {
    match cell.trim().to_uppercase().as_str() {
        "XY" | "G17" => Some(Plane::Xy),
        "YZ" | "G19" => Some(Plane::Yz),
        "ZX" | "G18" => Some(Plane::Zx),
        _ => None,
    }
}

/// 1 for counter-clockwise, -1 for clockwise.
fn sense_of(cell: &str) -> Option<f64> {
    let word: String = cell
        .chars()
        .filter(|letter| letter.is_alphanumeric())
        .collect();
    match word.to_lowercase().as_str() {
        "ccw" | "acw" | "counterclockwise" | "anticlockwise" | "g03" | "g3" => Some(1.0),
        "cw" | "clockwise" | "g02" | "g2" => Some(-1.0),
        _ => None,
    }
}

/// Cells of a column that hold anything, with their lines.
fn cells(lines: &Lines, k: usize) -> impl Iterator<Item = (u64, &str)> {
    let cells = lines
        .iter()
        .filter_map(move |(line, cells)| Some((*line, cells.get(k)?.as_str())));
    cells.filter(|(_, cell)| !cell.is_empty() && *cell != "-")
}

fn place<T>(
    head: &[String],
    lines: &Lines,
    names: &[&str],
    parse: fn(&str) -> Option<T>,
) -> Option<usize> {
    (0..head.len()).find(|k| {
        let lower = head[*k].to_lowercase();
        let mut words = lower.split(|letter: char| !letter.is_alphanumeric());
        let (mut n, mut n_said) = (0_usize, 0_usize);
        words.any(|word| names.contains(&word)) && {
            for (_, cell) in cells(lines, *k) {
                n += 1;
                n_said += usize::from(parse(cell).is_some());
            }
            2 * n_said > n
        }
    })
}

fn first<T>(
    head: &[String],
    lines: &Lines,
    names: &[&str],
    parse: fn(&str) -> Option<T>,
) -> Option<(String, T)> {
    let k = place(head, lines, names, parse)?;
    let said = cells(lines, k).find_map(|(_, cell)| parse(cell))?;
    Some((head[k].clone(), said))
}

fn same<T: PartialEq + Display>(
    (head, lines): (&[String], &Lines),
    k: usize,
    parse: fn(&str) -> Option<T>,
    (key, wanted): (&str, T),
) -> Result<()> {
    let other = cells(lines, k).find(|(_, cell)| parse(cell).as_ref() != Some(&wanted));
    let Some((line, cell)) = other else {
        return Ok(());
    };
    bail!(
        "line {line}, column \"{}\": \"{}\": the map says {key} {wanted}, and a test is of one {key}: write the rows of each {key} \
         into a table of their own and state it in the map, or rename the column where it says something else",
        shown(&head[k]),
        shown(cell)
    );
}

/// Refuses rows whose angles go the other way than they say.
fn sense((head, lines): (&[String], &Lines), k: usize, rows: &[Row]) -> Result<()> {
    let said: BTreeMap<u64, f64> = cells(lines, k)
        .filter_map(|(line, cell)| Some((line, sense_of(cell)?)))
        .collect();
    let way = |row: &Row| said.get(&row.line).copied().unwrap_or(0.0);
    let is_one = |a: &Row, b: &Row| {
        a.cells[0].total_cmp(&b.cells[0]).is_eq() && way(a).total_cmp(&way(b)).is_eq()
    };
    for rows in rows.chunk_by(is_one) {
        let steps = rows.windows(2).map(|two| two[1].cells[1] - two[0].cells[1]);
        // A step over the end of a turn is a small one.
        let turned: f64 = steps
            .map(|step| (step + 180.0).rem_euclid(360.0) - 180.0)
            .sum();
        let Some(row) = rows.first().filter(|row| way(row) * turned < 0.0) else {
            continue;
        };
        let [goes, says] = if turned > 0.0 {
            ["counter-clockwise (its angles ascend)", "clockwise"]
        } else {
            ["clockwise (its angles descend)", "counter-clockwise"]
        };
        bail!(
            "line {}, column \"{}\": run {} says {says} and goes {goes}: angles count from the plane's first axis towards its second: \
             correct the column or the angles",
            row.line,
            shown(&head[k]),
            row.cells[0]
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::sheet::Sheet;
    use super::super::table::Table;
    use super::*;

    const STOPS: &str = "positioning: {axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, run: n, target_mm: t, deviation_um: d}";
    const CIRCLE: &str = "circle: {plane: XY, centre_mm: [0.0, 0.0, 0.0], radius_mm: 100.0, feed_mm_min: 1000.0, run: n, angle_deg: t, radial_um: d}";

    /// The remarks on a table of one run in six rows, 60 deg (mm) apart, with another column.
    fn said(test: &str, name: &str, cells: [&str; 6], step: f64) -> String {
        let map: Map =
            serde_saphyr::from_str(&format!("start_s: 0\ntest:\n  {test}\n")).expect("a map");
        let mut text = format!("n,t,d,{name}\n");
        for (k, cell) in cells.into_iter().enumerate() {
            text.push_str(&format!("1,{},0.5,{cell}\n", step * k as f64));
        }
        let sheet = Sheet::of_text(&text, ',').expect("rows");
        match Table::of(&sheet, &map, &[None, None, None]) {
            Ok(_) => String::new(),
            Err(error) => format!("{error:#}"),
        }
    }

    #[test]
    fn rows_of_another_axis_or_plane_than_that_of_the_map_are_refused_with_their_line() {
        let two = ["X", "X", "X", "Y", "Y", "Y"];
        for (test, name, cells, words) in [
            (
                STOPS,
                "axis",
                ["Y"; 6],
                "line 2, column \"axis\": \"Y\": the map says axis X",
            ),
            (STOPS, "Achse", ["y"; 6], "line 2"),
            (STOPS, "axis name", ["Z axis"; 6], "line 2"),
            (STOPS, "axis", two, "line 5, column \"axis\": \"Y\""),
            (STOPS, "axis", ["X", "X", "", "X", "X", "?"], "line 7"),
            (
                CIRCLE,
                "plane",
                ["YZ"; 6],
                "line 2, column \"plane\": \"YZ\": the map says plane XY",
            ),
            (
                CIRCLE,
                "Ebene",
                ["XY", "XY", "XY", "XY", "ZX", "ZX"],
                "line 6",
            ),
        ] {
            let said = said(test, name, cells, 60.0);
            assert!(said.contains(words), "{words}: {said}");
        }
        for (test, name, cells) in [
            (STOPS, "axis", ["X"; 6]),
            (STOPS, "axis", ["x axis", "X", "", "-", "X", "X"]),
            (STOPS, "axis", ["1"; 6]),
            (STOPS, "remark", two),
            (CIRCLE, "plane", ["XY"; 6]),
        ] {
            assert_eq!(said(test, name, cells, 60.0), "", "{name} {cells:?}");
        }
    }

    #[test]
    fn angles_that_go_the_other_way_than_the_rows_say_are_refused() {
        for (cells, step, words) in [
            (
                ["cw"; 6],
                60.0,
                "line 2, column \"sense\": run 1 says clockwise and goes counter-clockwise",
            ),
            (
                ["CCW"; 6],
                -60.0,
                "says counter-clockwise and goes clockwise",
            ),
            (["counter-clockwise"; 6], -60.0, "line 2"),
            (["ccw", "ccw", "ccw", "cw", "cw", "cw"], 60.0, "line 5"),
            (["cw"; 6], -60.0, ""),
            (["ccw"; 6], 60.0, ""),
            (["?"; 6], 60.0, ""),
        ] {
            let said = said(CIRCLE, "sense", cells, step);
            assert!(
                said.contains(words) && said.is_empty() == words.is_empty(),
                "{words}: {said}"
            );
        }
    }

    #[test]
    fn a_sense_holds_over_the_end_of_a_turn() {
        let cells = ["cw"; 6];
        let wrapped = |step: f64| {
            let map: Map =
                serde_saphyr::from_str(&format!("start_s: 0\ntest:\n  {CIRCLE}\n")).expect("a map");
            let rows = (0..6).zip(cells).map(|(k, cell)| {
                let angle = (300.0 + step * f64::from(k)).rem_euclid(360.0);
                format!("1,{angle},0.5,{cell}\n")
            });
            let text = format!("n,t,d,sense\n{}", rows.collect::<String>());
            let sheet = Sheet::of_text(&text, ',').expect("rows");
            Table::of(&sheet, &map, &[None, None, None]).is_ok()
        };
        assert!(wrapped(-50.0));
        assert!(!wrapped(50.0));
    }
}
