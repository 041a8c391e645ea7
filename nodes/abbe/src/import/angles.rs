//! Whether a column of angles can be one of degrees.
//!
//! A turn has 360 deg, 400 gon and 2 pi rad. A map may state the unit, or the column's name ([`super::stated`]); where they do
//! not, a turn that closes at another number shows that it is not the degree, and the table is refused with what to state.

use anyhow::{Result, bail};
use metrology::Axis;
use metrology::number::number;

use super::map::{Map, Test};
use super::table::Table;

/// A turn, gon.
const TURN_GON: f64 = 400.0;
/// Turns in gon after which a run may end.
const TURNS: [f64; 3] = [1.0, 2.0, 3.0];
/// With coarser angles a turn of 400 looks like one of 360.
const COARSEST: f64 = 20.0;

/// Refuses a table whose angles are in another unit than that of the map.
///
/// # Errors
/// With column, what shows the unit, and what to state.
pub fn check(map: &Map, table: &Table) -> Result<()> {
    let is_open = |column: &str| !map.units.contains_key(column);
    match &map.test {
        Test::Circle { angle_deg, .. } if is_open(angle_deg) => circle(angle_deg, table),
        Test::Positioning {
            axis, target_mm, ..
        } if !axis.is_linear() && is_open(target_mm) => targets(*axis, target_mm, table),
        _ => Ok(()),
    }
}

fn circle(column: &str, table: &Table) -> Result<()> {
    if says_deg(column) {
        return Ok(());
    }
    let rows = &table.rows;
    for rows in rows.chunk_by(|a, b| a.cells[0].total_cmp(&b.cells[0]).is_eq()) {
        let angles: Vec<f64> = rows.iter().map(|row| row.cells[1]).collect();
        if let (Some(sweep), Some(first)) = (turn_of_gon(&angles), rows.first()) {
            bail!(
                "line {}, column \"{column}\": run {} goes round at {}: 400 to a turn is gon: {}",
                first.line,
                first.cells[0],
                number(sweep),
                remedy(column, "gon")
            );
        }
    }
    Ok(())
}

fn targets(axis: Axis, column: &str, table: &Table) -> Result<()> {
    let targets: Vec<f64> = table.rows.iter().map(|row| row.cells[1]).collect();
    match turn_of_targets(&targets) {
        Some((unit, span)) if !says_deg(column) => bail!(
            "column \"{column}\": targets of {axis} span {}, a turn in {unit}: {}",
            number(span),
            remedy(column, unit)
        ),
        _ => Ok(()),
    }
}

fn remedy(column: &str, unit: &str) -> String {
    format!("state `units: {{\"{column}\": {unit}}}` in the map, or `deg` where they are degrees")
}

fn says_deg(column: &str) -> bool {
    let lower = column.to_lowercase();
    let mut words = lower.split(|letter: char| !letter.is_alphanumeric());
    lower.contains('°') || words.any(|word| matches!(word, "deg" | "degree" | "degrees"))
}

/// Where the angles of a run go round at 400: at a jump back, or at the run's end.
fn turn_of_gon(angles: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = angles
        .windows(2)
        .map(|two| (two[1] - two[0]).abs())
        .collect();
    let all = steps.clone();
    steps.sort_by(f64::total_cmp);
    let step = *steps.get(steps.len() / 2)?;
    if !(step > 0.0 && step <= COARSEST) {
        return None;
    }
    if let Some(jump) = all
        .iter()
        .find(|jump| (*jump + step - TURN_GON).abs() <= step / 2.0)
    {
        return Some(jump + step);
    }
    let sweep = (angles.last()? - angles.first()?).abs();
    let closes = |turn: f64| (turn - 1.5 * step..=turn + 0.5 * step).contains(&sweep);
    TURNS
        .into_iter()
        .any(|turns| closes(turns * TURN_GON))
        .then_some(sweep)
}

/// A turn that targets span in another unit than the degree, with the span.
fn turn_of_targets(targets: &[f64]) -> Option<(&'static str, f64)> {
    let mut sorted = targets.to_vec();
    sorted.sort_by(f64::total_cmp);
    let span = sorted.last()? - sorted.first()?;
    let spacings = sorted.windows(2).map(|two| two[1] - two[0]);
    let spacing = spacings
        .filter(|spacing| *spacing > span * 1e-6)
        .fold(f64::INFINITY, f64::min);
    if (span - TURN_GON).abs() <= 0.5 * spacing.min(COARSEST) {
        return Some(("gon", span));
    }
    let turn_rad = std::f64::consts::TAU;
    ((span - turn_rad).abs() <= 1e-3 * turn_rad).then_some(("rad", span))
}

#[cfg(test)]
mod tests {
    use super::super::sheet::Sheet;
    use super::*;

    const CIRCLE: &str = "circle: {plane: XY, centre_mm: [0.0, 0.0, 0.0], radius_mm: 100.0, feed_mm_min: 1000.0, run: n, angle_deg: \"COLUMN\", radial_um: r}";
    const STOPS: &str = "positioning: {axis: C, feed_deg_min: 1000.0, dwell_s: 2.0, overrun_deg: 5.0, run: n, target_deg: \"COLUMN\", deviation_arcsec: r}";

    fn map(test: &str, units: &str) -> Map {
        let text = format!("start_s: 1767600000\nunits: {units}\ntest:\n  {test}\n");
        serde_saphyr::from_str(&text).expect("a map")
    }

    fn sheet(text: &str) -> Sheet {
        Sheet::of_text(text, ',').expect("rows")
    }

    fn read(
        test: &str,
        (column, units): (&str, &str),
        angles: impl Iterator<Item = f64>,
    ) -> Result<Table> {
        let map = map(&test.replace("COLUMN", column), units);
        let mut text = format!("n,{column},r\n");
        for angle in angles {
            text.push_str(&format!("1,{angle},0\n"));
        }
        let table = Table::of(&sheet(&text), &map, &[None, None, None])?;
        map.check_columns()?;
        check(&map, &table).map(|()| table)
    }

    fn said(test: &str, column: &str, angles: impl Iterator<Item = f64>) -> String {
        match read(test, (column, "{}"), angles) {
            Ok(_) => String::new(),
            Err(error) => format!("{error:#}"),
        }
    }

    /// So many even steps of so much.
    fn steps(n: u32, step: f64) -> impl Iterator<Item = f64> {
        (0..=n).map(move |k| f64::from(k) * step)
    }

    #[test]
    fn a_turn_of_400_is_no_turn_of_degrees() {
        for angles in [
            steps(100, 4.0).collect::<Vec<_>>(),
            // Without the row that closes the turn, backwards, two turns on, two turns that jump back.
            steps(99, 4.0).collect(),
            steps(400, -1.0).collect(),
            steps(160, 5.0).collect(),
            steps(99, 4.0).chain(steps(99, 4.0)).collect(),
        ] {
            let shown = said(CIRCLE, "w", angles.into_iter());
            assert!(shown.contains("400 to a turn is gon"), "{shown}");
            assert!(
                shown.contains("state `units: {\"w\": gon}` in the map, or `deg`"),
                "{shown}"
            );
        }
        for (n, step) in [(360, 1.0), (36, 10.0), (90, 6.0), (110, 2.0), (450, 1.0)] {
            assert_eq!(said(CIRCLE, "w", steps(n, step)), "", "{n} of {step}");
        }
        // Degrees by name: from 20 deg before a turn to 20 deg behind it.
        assert_eq!(said(CIRCLE, "angle_deg", steps(100, 4.0)), "");
        let stated = read(CIRCLE, ("w", "{w: deg}"), steps(100, 4.0));
        assert!(stated.is_ok());
    }

    /// 100 gon are 90 deg, a turn has 2 pi rad.
    #[test]
    fn a_stated_unit_is_converted() {
        for (unit, quarter) in [
            ("deg", 90.0),
            ("gon", 100.0),
            ("rad", std::f64::consts::FRAC_PI_2),
            ("turn", 0.25),
        ] {
            let units = format!("{{w: {unit}}}");
            let angles = [0.0, quarter, 2.0 * quarter].into_iter();
            let table = read(CIRCLE, ("w", &units), angles).expect(unit);
            for (row, deg) in table.rows.iter().zip([0.0, 90.0, 180.0]) {
                assert!((row.cells[1] - deg).abs() < 1e-9, "{unit}: {row:?}");
            }
        }
    }

    #[test]
    fn a_unit_in_the_name_of_a_column_is_taken_at_its_word() {
        for (column, unit) in [
            ("angle_gon", "gon"),
            ("Winkel [gon]", "gon"),
            ("phi (rad)", "rad"),
            ("phi mrad", "mrad"),
            ("phi_µrad", "µrad"),
        ] {
            let shown = said(CIRCLE, column, steps(36, 10.0));
            let words = format!("column \"{column}\": its name says {unit}");
            assert!(shown.contains(&words), "{shown}");
        }
        for column in ["radius angle", "grade", "angle"] {
            assert_eq!(said(CIRCLE, column, steps(36, 10.0)), "");
        }
        let deviations = STOPS
            .replace("arcsec: r", "arcsec: d_mgon")
            .replace("COLUMN", "t");
        let shown = map(&deviations, "{}").check_columns().expect_err("mgon");
        let shown = shown.to_string();
        let words = "says \"mgon\", which is no unit that is known, and the map arcsec";
        assert!(shown.contains(words), "{shown}");
    }

    #[test]
    fn targets_of_a_rotary_axis_over_a_turn_of_gon_or_radians_are_refused() {
        let tau = std::f64::consts::TAU;
        for (n, step, unit) in [
            (10, 40.0, "gon"),
            (40, 10.0, "gon"),
            (12, tau / 12.0, "rad"),
        ] {
            let shown = said(STOPS, "t", steps(n, step));
            let words = format!("state `units: {{\"t\": {unit}}}`");
            assert!(shown.contains(&words), "{unit}: {shown}");
        }
        for (n, step) in [(12, 30.0), (9, 40.0), (36, 10.0), (12, 1.0)] {
            assert_eq!(said(STOPS, "t", steps(n, step)), "", "{n} of {step}");
        }
    }
}
