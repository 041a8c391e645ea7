//! Lists of touches without names: three numbers a line, X Y Z in mm, where their points are of a sphere, a ring or one place.
//!
//! Three numbers may as well be targets with deviations or times with readings: such columns are on no sphere. A list is taken
//! for touches only where its first points are of a shape that touches have (`touch_shapes`), far enough from zero for positions.

use anyhow::Result;
use nalgebra::Vector3;

use super::probe_log;
use super::sheet::Cells;
use super::touch_shapes::{self, Shape};

/// X, Y and Z.
const NUMBERS_A_LINE: usize = 3;
/// Points of the begin that are looked at, and the fewest of them that tell a shape.
const MOST_LOOKED_AT: usize = 25;
const LEAST_OF_A_SHAPE: usize = 6;
/// Readings of gauges lie nearer to zero, and no ball of a probe or artefact is smaller, mm.
const LEAST_OFF_MM: f64 = 10.0;
const LEAST_RADIUS_MM: f64 = 1.0;
/// Columns that change and stay nearer to zero are of a gauge, mm.
const LEAST_POSITION_MM: f64 = 0.5;

/// The numbers of a line, as text with points before decimals; `None` of any other line.
fn numbers(line: &str) -> Option<Vec<String>> {
    let separators: &[char] = match (line.contains(';'), line.contains('\t')) {
        (true, _) => &[';'],
        (false, true) => &['\t'],
        // A comma between blanks is before decimals.
        (false, false) if line.contains(' ') && !line.contains(", ") => &[' '],
        (false, false) => &[','],
    };
    let cells = line.split(separators).map(str::trim);
    let cells = cells.filter(|cell| !cell.is_empty());
    let number = |cell: &str| {
        let text = if separators == [','] {
            cell.to_owned()
        } else {
            cell.replace(',', ".")
        };
        text.parse::<f64>()
            .is_ok_and(f64::is_finite)
            .then_some(text)
    };
    let found: Option<Vec<String>> = cells.map(number).collect();
    found.filter(|found| found.len() == NUMBERS_A_LINE)
}

/// The points before the first empty line; `None` where any line is of another form.
fn first_points(text: &str) -> Option<Vec<Vector3<f64>>> {
    let lines = probe_log::filled(text);
    if !lines.iter().all(|line| numbers(line).is_some()) {
        return None;
    }
    let own = text
        .lines()
        .map(str::trim)
        .skip_while(|line| line.is_empty());
    let own = own.take_while(|line| !line.is_empty()).take(MOST_LOOKED_AT);
    let point = |line: &str| {
        let all: Vec<f64> = numbers(line)?
            .iter()
            .filter_map(|cell| cell.parse().ok())
            .collect();
        Some(Vector3::from_column_slice(&all))
    };
    own.map(point).collect()
}

/// Whether a text is such a list.
pub fn is_one(text: &str) -> bool {
    let Some(points) = first_points(text) else {
        return false;
    };
    // Readings of a gauge go to and fro about zero; a position stands or goes farther.
    let is_gauge = |axis: usize| {
        let all = || points.iter().map(|point| point[axis]);
        let first = points.first().map_or(0.0, |point| point[axis]);
        all().all(|mm| mm.abs() < LEAST_POSITION_MM) && all().any(|mm| mm.total_cmp(&first).is_ne())
    };
    if (0..NUMBERS_A_LINE).any(is_gauge) {
        return false;
    }
    let is_far = points.iter().all(|point| point.amax() > LEAST_OFF_MM);
    let lengths = (LEAST_OF_A_SHAPE..=points.len()).rev();
    let mut shapes = lengths.filter_map(|n| touch_shapes::of(&points[..n]).ok());
    shapes.any(|shape| match shape {
        Shape::Place(_) => is_far,
        Shape::Sphere(round) | Shape::Ring(round, _) => round.radius_mm >= LEAST_RADIUS_MM,
    })
}

/// The table of such a list.
///
/// # Errors
/// Names the line beyond which no more is read.
pub fn cells(text: &str) -> Result<Cells> {
    let remark = "warning, three columns without names: taken for X, Y and Z in mm, as their points are of one shape; write a first line of names \
                  where they are others";
    let read = |line: &str| {
        let words = ['X', 'Y', 'Z'].into_iter().zip(numbers(line)?);
        Some(words.collect())
    };
    probe_log::table(text, &read, vec![remark.to_owned()])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seven points of a sphere with a radius of 15 mm about (100, -50, 20) mm.
    fn sphere(separator: &str, decimal: char) -> String {
        let around = (0..6).map(|k| {
            let (sin, cos) = f64::from(k).sin_cos();
            [100.0 + 12.0 * cos, -50.0 + 12.0 * sin, 29.0]
        });
        let all = around.chain([[100.0, -50.0, 35.0]]);
        let line = |point: [f64; 3]| {
            let cells = point.map(|mm| format!("{mm:.4}").replace('.', &decimal.to_string()));
            cells.join(separator) + "\n"
        };
        all.map(line).collect()
    }

    #[test]
    fn three_numbers_a_line_are_touches_where_they_are_of_a_shape() {
        for (separator, decimal) in [
            (",", '.'),
            (" ", '.'),
            ("\t", '.'),
            (";", ','),
            (" ", ','),
            (", ", '.'),
        ] {
            let text = sphere(separator, decimal);
            assert!(is_one(&text), "{text}");
            let read = cells(&(text.clone() + "\n" + &text)).unwrap();
            assert_eq!(read.sheet.lines[0].1, ["run", "x", "y", "z"]);
            assert_eq!(
                read.sheet.lines[1].1,
                ["1", "112.0000", "-50.0000", "29.0000"]
            );
            assert_eq!(read.sheet.lines.len(), 15);
        }
        let place = "100.001 -50.0 20.0\n".repeat(6);
        assert!(is_one(&place));
    }

    #[test]
    fn other_tables_of_three_columns_are_no_touches() {
        let lines = |of: fn(f64) -> [f64; 3]| -> String {
            let all = (0..20).map(|k| of(f64::from(k)).map(|one| one.to_string()).join(","));
            all.collect::<Vec<_>>().join("\n")
        };
        for text in [
            lines(|k| [50.0 * k, 1.0 + 0.3 * (7.0 * k).sin(), 2.0]),
            lines(|k| [k + 1.0, 50.0 * (k % 5.0), 0.5 * (3.0 * k).sin()]),
            lines(|k| [60.0 * k, 20.0 + 0.1 * k, 0.4 * k]),
            lines(|k| [0.001 * (5.0 * k).sin(), 0.002, 0.001 * k]),
            lines(|k| [k, 2.0 * k, 3.0 * k]),
            lines(|k| [50.0 * k.cos(), 50.0 * k.sin(), 0.003 * (5.0 * k).sin()]),
            lines(|k| [500.0, 20.1, 0.002 * (3.0 * k).cos()]),
            sphere(",", '.').replacen("112", "N1", 1),
            "1 2\n".repeat(9),
            String::new(),
        ] {
            assert!(!is_one(&text), "{text}");
        }
    }
}
