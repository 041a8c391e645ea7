//! Touches of a list as runs of a bag: which of them belong together, and what they are of.
//!
//! Without a column of the run a list is parted where it begins again at its first places, and where a pause is much longer than
//! the others. Positions are those of the ball's centre, as a control latches them: no radius is taken off, and no pretravel.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, bail};
use metrology::number::number;
use nalgebra::Vector3;

use super::map::{Map, Test};
use super::runs::Runs;
use super::table::{Row, Table};
use super::touch_shapes::{self, SAME_PLACE_MM, Shape};

/// Places of the cells of a row.
const RUN: usize = 0;
const FEATURE: usize = 1;
const FIRST_OF_PLACE: usize = 2;
pub(super) const TIME: usize = 5;
/// A pause parts two measurements that is so many times as long as the usual one.
const LONG_PAUSE: f64 = 10.0;
/// Touches of a place in several rounds are nearer than this part of the distance to any other place of a round.
const SAME_TO_OTHERS: f64 = 0.25;
/// Most touches of a round that are looked for.
const MOST_OF_A_ROUND: usize = 1_000;
/// Most features and most touches of a list.
const MOST_FEATURES: usize = 100;
const MOST_TOUCHES: usize = 100_000;
/// Longest name of a feature, letters.
const LONGEST_NAME: usize = 40;
/// Measurements that are listed one by one.
const LISTED: usize = 12;

/// Rows as every list has them: run, feature, place, and the time where there is one.
pub fn shaped(rows: Vec<Row>, test: &Test) -> Vec<Row> {
    let Test::Touches { run, feature, .. } = test else {
        return rows;
    };
    let (has_run, has_feature) = (run.is_some(), feature.is_some());
    let shape = |Row { line, cells }: Row| {
        let mut cells = cells.into_iter();
        let mut next = |has: bool| {
            if has {
                cells.next().unwrap_or(0.0)
            } else {
                0.0
            }
        };
        let mut all = vec![next(has_run), next(has_feature)];
        all.extend(cells);
        Row { line, cells: all }
    };
    rows.into_iter().map(shape).collect()
}

/// Number of a name among those that were read before.
pub fn feature_of(cell: &str, features: &mut Vec<String>) -> f64 {
    let name: String = match cell.trim() {
        "" => "not named".to_owned(),
        name => name.chars().take(LONGEST_NAME).collect(),
    };
    let known = features.iter().position(|known| *known == name);
    known.unwrap_or_else(|| {
        features.push(name);
        features.len() - 1
    }) as f64
}

/// Refuses a list whose axes are in several units.
///
/// # Errors
/// With two columns and their units.
pub fn check_units(map: &Map) -> Result<()> {
    let Test::Touches {
        x_mm, y_mm, z_mm, ..
    } = &map.test
    else {
        return Ok(());
    };
    let unit = |name: &String| map.units.get(name).map_or("mm", |unit| unit.name());
    for other in [y_mm, z_mm] {
        if unit(x_mm) != unit(other) {
            bail!(
                "columns \"{x_mm}\" in {} and \"{other}\" in {}: the axes of a list of touches have one unit: correct `units` or the list",
                unit(x_mm),
                unit(other)
            );
        }
    }
    Ok(())
}

/// Touches of one feature in one run.
struct Measurement {
    run: u32,
    feature: usize,
    rows: Vec<Row>,
}

pub(super) fn place(row: &Row) -> Vector3<f64> {
    let cell = |k: usize| {
        row.cells
            .get(FIRST_OF_PLACE + k)
            .copied()
            .unwrap_or(f64::NAN)
    };
    Vector3::new(cell(0), cell(1), cell(2))
}

pub(super) fn places(rows: &[Row]) -> Vec<Vector3<f64>> {
    rows.iter().map(place).collect()
}

pub(super) fn feature(row: &Row) -> usize {
    row.cells.get(FEATURE).map_or(0, |number| *number as usize)
}

/// The runs of a list.
///
/// # Errors
/// Names line and points of what is no place, sphere or ring.
pub fn runs(test: &Test, table: &Table) -> Result<Runs> {
    let Test::Touches { run, feature, .. } = test else {
        bail!("no list of touches");
    };
    let rows = &table.rows;
    if rows.len() > MOST_TOUCHES || table.features.len() > MOST_FEATURES {
        bail!(
            "{} touches of {} features: at most {MOST_TOUCHES} of {MOST_FEATURES}: part the list",
            rows.len(),
            table.features.len()
        );
    }
    let mut remarks = vec![];
    let numbers: BTreeSet<u64> = rows.iter().map(|row| row.cells[RUN].to_bits()).collect();
    // A number for each touch is none of a run.
    let is_numbered = run.is_some() && (numbers.len() < rows.len() || rows.len() == 1);
    if let (Some(run), false) = (run, is_numbered) {
        remarks.push(format!(
            "column \"{run}\": another number for each touch: taken for the number of the touch, and not of a run"
        ));
    }
    let mut all = if is_numbered {
        by_number(rows)
    } else {
        parted(rows, &mut remarks)
    };
    let shapes = match (shapes_of(&all, &table.features), feature) {
        (Ok(shapes), Some(_)) => shapes,
        (Ok(shapes), None) => {
            tell_apart(&mut all, &shapes);
            shapes
        }
        (Err(refused), Some(_)) => return Err(refused),
        (Err(refused), None) => {
            all = by_place(rows).ok_or(refused)?;
            remarks.push(
                "touches of several places, each touched again and again: parted by place"
                    .to_owned(),
            );
            shapes_of(&all, &table.features)?
        }
    };
    remarks.extend(in_words(&all, &shapes, &table.features));
    Ok(Runs {
        runs: by_run(all),
        remarks,
        is_order_known: true,
    })
}

/// Rows by their number of run, in the order of coming, and by feature.
fn by_number(rows: &[Row]) -> Vec<Measurement> {
    let mut places: BTreeMap<(u64, usize), usize> = BTreeMap::new();
    let mut runs: Vec<u64> = vec![];
    let mut all: Vec<Measurement> = vec![];
    for row in rows {
        let number = row.cells[RUN].to_bits();
        let run = runs.iter().position(|known| *known == number);
        let run = run.unwrap_or_else(|| {
            runs.push(number);
            runs.len() - 1
        });
        let key = (number, feature(row));
        let at = *places.entry(key).or_insert(all.len());
        match all.get_mut(at) {
            Some(known) => known.rows.push(row.clone()),
            None => all.push(Measurement {
                run: run as u32,
                feature: feature(row),
                rows: vec![row.clone()],
            }),
        }
    }
    all
}

/// Rows without a number of run: those of a feature one after another, parted where they begin again or pause.
fn parted(rows: &[Row], remarks: &mut Vec<String>) -> Vec<Measurement> {
    let mut all = vec![];
    let mut n_rounds = 0;
    for chunk in rows.chunk_by(|a, b| feature(a) == feature(b)) {
        let feature = chunk.first().map_or(0, feature);
        let parts = rounds(chunk).or_else(|| pauses(chunk));
        n_rounds += parts.as_ref().map_or(0, Vec::len);
        let parts = parts.unwrap_or_else(|| vec![chunk.to_vec()]).into_iter();
        all.extend(parts.map(|rows| Measurement {
            run: 0,
            feature,
            rows,
        }));
    }
    number_runs(&mut all);
    if n_rounds > 0 {
        remarks.push(format!(
            "no number of a run: the list was parted into {n_rounds} runs, where it begins again at its first places or pauses"
        ));
    }
    all
}

/// Numbers the runs of measurements in their order: each is a run of its own, unless a feature comes again after another one. Then
/// the first ones of all features are a run, and so on.
fn number_runs(all: &mut [Measurement]) {
    let mut blocks: Vec<usize> = all.iter().map(|one| one.feature).collect();
    blocks.dedup();
    let n_features = blocks.iter().collect::<BTreeSet<_>>().len();
    let comes_again = n_features < blocks.len();
    let mut counted: BTreeMap<usize, u32> = BTreeMap::new();
    for (k, one) in (0..).zip(all) {
        let own = counted.entry(one.feature).or_insert(0);
        one.run = if comes_again { *own } else { k };
        *own += 1;
    }
}

/// Touches of several places in one run, each of which was touched often enough.
fn by_place(rows: &[Row]) -> Option<Vec<Measurement>> {
    let mut all: Vec<Measurement> = vec![];
    for row in rows {
        let is_at = |one: &&mut Measurement| {
            let first = one.rows.first().map(place);
            first.is_some_and(|first| (first - place(row)).norm() <= SAME_PLACE_MM)
        };
        if let Some(known) = all.iter_mut().find(is_at) {
            known.rows.push(row.clone());
            continue;
        }
        if all.len() == MOST_FEATURES {
            return None;
        }
        all.push(Measurement {
            run: 0,
            feature: all.len(),
            rows: vec![row.clone()],
        });
    }
    let are_places = all
        .iter()
        .all(|one| touch_shapes::of(&places(&one.rows)).is_ok());
    are_places.then_some(all)
}

/// The rounds of a list that comes back to its first places in the same order; touches of one place are one round.
fn rounds(rows: &[Row]) -> Option<Vec<Vec<Row>>> {
    let points = places(rows);
    if touch_shapes::is_place(&points) {
        return None;
    }
    let n = points.len();
    let apart_mm = |a: usize, b: usize| (points[a] - points[b]).norm();
    let is_round = |of: &usize| {
        let back_mm = (*of..n).map(|k| apart_mm(k, k - of)).fold(0.0, f64::max);
        let spacing_mm = (0..*of).flat_map(|a| (0..a).map(move |b| (a, b)));
        let spacing_mm = spacing_mm.map(|(a, b)| apart_mm(a, b));
        back_mm <= SAME_PLACE_MM
            && back_mm < SAME_TO_OTHERS * spacing_mm.fold(f64::INFINITY, f64::min)
    };
    let of = (2..=(n / 2).min(MOST_OF_A_ROUND))
        .filter(|of| n.is_multiple_of(*of))
        .find(is_round)?;
    Some(rows.chunks(of).map(<[Row]>::to_vec).collect())
}

/// The parts of a list between pauses that are much longer than the usual one; touches of one place are one part.
fn pauses(rows: &[Row]) -> Option<Vec<Vec<Row>>> {
    let time = |row: &Row| row.cells.get(TIME).copied();
    let times: Vec<f64> = rows.iter().map(time).collect::<Option<_>>()?;
    let mut steps: Vec<f64> = times.windows(2).map(|two| two[1] - two[0]).collect();
    steps.sort_by(f64::total_cmp);
    let usual_s = steps
        .get(steps.len() / 2)
        .copied()
        .filter(|step| *step > 0.0)?;
    if touch_shapes::is_place(&places(rows)) {
        return None;
    }
    let is_next = |a: &Row, b: &Row| match (time(a), time(b)) {
        (Some(a), Some(b)) => b - a <= LONG_PAUSE * usual_s,
        _ => true,
    };
    let parts: Vec<Vec<Row>> = rows.chunk_by(is_next).map(<[Row]>::to_vec).collect();
    (parts.len() > 1).then_some(parts)
}

fn shapes_of(all: &[Measurement], features: &[String]) -> Result<Vec<Shape>> {
    all.iter().map(|one| shape(one, features)).collect()
}

fn shape(one: &Measurement, features: &[String]) -> Result<Shape> {
    let line = one.rows.first().map_or(0, |row| row.line);
    let of = features.get(one.feature);
    let of = of.map_or_else(String::new, |name| format!(" of \"{name}\""));
    touch_shapes::of(&places(&one.rows)).map_err(|found| {
        anyhow::anyhow!(
            "line {line}, run {}{of}: {found}. A list of touches is evaluated as one place touched again and again, a sphere, or a ring or \
             bore in one plane: part other touches off, or tell measurements apart by columns run and feature",
            one.run + 1
        )
    })
}

/// Numbers the features of measurements by where they are: those of one kind at one place repeat one another.
fn tell_apart(all: &mut [Measurement], shapes: &[Shape]) {
    let mut known: Vec<(&'static str, Vector3<f64>)> = vec![];
    for (one, shape) in all.iter_mut().zip(shapes) {
        let centre_mm = shape.centre_mm(&places(&one.rows));
        let is_same = |(name, at): &(&str, Vector3<f64>)| {
            *name == shape.name() && (at - centre_mm).norm() <= SAME_PLACE_MM
        };
        one.feature = known.iter().position(is_same).unwrap_or_else(|| {
            known.push((shape.name(), centre_mm));
            known.len() - 1
        });
    }
    number_runs(all);
}

/// The rows of each run in the order of the list, with run and feature in their cells.
fn by_run(all: Vec<Measurement>) -> Vec<Vec<Row>> {
    let mut runs: BTreeMap<u32, Vec<Row>> = BTreeMap::new();
    for one in all {
        let own = runs.entry(one.run).or_default();
        own.extend(one.rows.into_iter().map(|mut row| {
            row.cells[RUN] = f64::from(one.run);
            row.cells[FEATURE] = one.feature as f64;
            row
        }));
    }
    let mut runs: Vec<Vec<Row>> = runs.into_values().collect();
    for rows in &mut runs {
        rows.sort_by_key(|row| row.line);
    }
    runs
}

/// What was recognised, and what is assumed of it.
fn in_words(all: &[Measurement], shapes: &[Shape], features: &[String]) -> Vec<String> {
    let mut lines: Vec<String> = all
        .iter()
        .zip(shapes)
        .take(LISTED)
        .map(|(one, shape)| {
            let n = one.rows.len();
            let name = name(one.feature, shape, features);
            let of = match shape {
                Shape::Place(along) => format!("touches of one place, along ({})", listed(along)),
                Shape::Sphere(round) => format!("points on a sphere, diameter {} mm with the tip", diameter(round)),
                Shape::Ring(round, normal) => format!(
                    "points on a ring or bore, diameter {} mm between centres of the tip, normal ({})",
                    diameter(round),
                    listed(normal)
                ),
            };
            format!("{name}, run {}: {n} {of}", one.run + 1)
        })
        .collect();
    if all.len() > LISTED {
        lines.push(format!("{} more measurements", all.len() - LISTED));
    }
    lines.push(
        "assumed: positions of the centre of the stylus ball, with pretravel; a diameter is that of sphere and ball together (of a bore: less \
         the ball), and rotary axes stood still"
            .to_owned(),
    );
    lines
}

fn diameter(round: &touch_shapes::Round) -> String {
    number((2e4 * round.radius_mm).round() / 1e4)
}

fn listed(direction: &Vector3<f64>) -> String {
    let parts = direction
        .iter()
        .map(|part| number((part * 1e3).round() / 1e3));
    parts.collect::<Vec<_>>().join(", ")
}

/// Name of a feature; of one without that of its kind.
pub(super) fn name(feature: usize, shape: &Shape, features: &[String]) -> String {
    match features.get(feature) {
        Some(name) => name.clone(),
        None if feature == 0 => shape.name().to_owned(),
        None => format!("{} {}", shape.name(), feature + 1),
    }
}
