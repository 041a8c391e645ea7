//! The published separation of each circle with stops, as it prints single errors, beside what the circle determines.

use grid_encoder::comparison::{Compared, Comparison, Fourteen, compare};
use grid_encoder::geometry::geometry_model;
use grid_encoder::spectrum::Visibility;
use grid_encoder::unknown::Unknown;
use metrology::Axis;
use metrology::sample::{GeometryModel, TestPlane};
use metrology::stamp::Stamp;

use super::geometry::{self, Sum, coefficients};
use super::section::{Rows, Section, head, rounded, um};
use super::terminal::Rank;
use crate::evaluate::circles::plane_axes;
use crate::evaluate::stationwise::StationCircle;

/// Every element of the other arbitrary vector, U of the source, mm at the radius.
const OTHER_MM: f64 = 0.005;
/// Coverage factor of what is printed.
const COVERAGE: f64 = 2.0;

/// What all recordings together say of one unknown, mm at the circle's radius.
#[derive(Clone, Copy, Debug, serde::Serialize)]
struct Together {
    value_mm: f64,
    standard_uncertainty_mm: f64,
}

/// Two parts, the comparison and what the circle determines; none where the circle cannot be compared.
#[must_use]
pub fn sections(circle: &StationCircle, all: Option<&GeometryModel>) -> Vec<Section> {
    let place = &circle.recording.place;
    let letters = plane_axes(place.plane).map_or_else(String::new, |[u, v]| format!("{u}{v}"));
    let [u, v] = grid_encoder::recording::in_plane(place.plane, &place.centre_mm);
    let about = if u.hypot(v) > 0.0 {
        format!(" about ({u:.0}, {v:.0}) mm")
    } else {
        String::new()
    };
    let run = circle.recording.run;
    let title = format!(
        "One circle {letters}, R {:.0} mm{about}, run {run}: the published separation and what it determines",
        place.radius_mm
    );
    let of_all = |compared: &Compared| together(all?, compared, normal(place.plane)?);
    match compare(&circle.kinematics, &circle.recording, OTHER_MM) {
        Ok(None) => Vec::new(),
        Ok(Some(found)) => {
            let chain = circle.kinematics.chain().to_string();
            let model = geometry_model(&found.determined, &chain, Stamp::from_nanos(0), 1);
            let title_alone = format!("What the circle of run {run} alone determines");
            let mut alone = geometry::section_of_one_circle(&title_alone, &model);
            alone.lines.extend(other_sense(circle, &model));
            vec![
                comparison((run, title), &found, &of_all).ranked(Rank::Detail),
                alone.ranked(Rank::Detail),
            ]
        }
        Err(error) => {
            let mut section = Section::new(title);
            section.not_evaluated(error);
            vec![section]
        }
    }
}

/// Which sums the same circle in the other sense contradicts; none where it was not run, or contradicts nothing.
fn other_sense(circle: &StationCircle, model: &GeometryModel) -> Option<String> {
    let other = circle.other_sense.as_ref()?;
    let found = compare(&circle.kinematics, other, OTHER_MM).ok()??;
    let turned = geometry_model(&found.determined, &model.chain, Stamp::from_nanos(0), 1);
    let (own, turned) = (geometry::sums(model), geometry::sums(&turned));
    let pair = |sum| Some((sum, turned.iter().find(|other| is_same(sum, other))?));
    let pairs: Vec<(&Sum, &Sum)> = own.iter().filter_map(pair).collect();
    let beyond = |(a, b): &(&Sum, &Sum)| {
        let u_mm = COVERAGE * a.standard_uncertainty_mm.hypot(b.standard_uncertainty_mm);
        (a.value_mm - b.value_mm).abs() / u_mm
    };
    let contradicted = pairs.iter().filter(|pair| beyond(pair) > 1.0);
    let n = contradicted.clone().count();
    let (a, b) = contradicted.max_by(|p, q| beyond(p).total_cmp(&beyond(q)))?;
    let words = |sum: &Sum| {
        let expanded_mm = COVERAGE * sum.standard_uncertainty_mm;
        let (value, u) = rounded(sum.value_mm * 1e3, expanded_mm * 1e3);
        format!("{value} ± {u} µm")
    };
    Some(format!(
        "Do not use these sums as they stand: run {}, the same circle in the other sense, contradicts {n} of {}. {} is {} here and {} there. One sense cannot tell these errors from a lost motion that is no step.",
        other.run,
        pairs.len(),
        a.in_words(),
        words(a),
        words(b)
    ))
}

/// Whether both are one sum at one distance.
fn is_same(a: &Sum, b: &Sum) -> bool {
    a.in_words() == b.in_words() && (a.at_mm - b.at_mm).abs() < 1e-6
}

fn comparison(
    (run, title): (u32, String),
    found: &Comparison,
    of_all: &dyn Fn(&Compared) -> Option<Together>,
) -> Section {
    let mut section = Section::new(title);
    let n = found.unknowns.len();
    let seen = found.unknowns.iter().filter(|c| is_seen(c)).count();
    let imprecise = match found.unknowns.iter().filter(|c| is_below_u(c)).count() {
        0 => String::new(),
        k => format!(", {k} of them with a U above the value (~)"),
    };
    section.lines.push(format!(
        "{} stations of {:.0} readings each give the published equations rank {} for {n} unknowns: their solution has {} arbitrary numbers, the source's vector U, here a (it is no uncertainty).",
        found.n_stations,
        found.readings_per_station,
        found.rank,
        n - found.rank
    ));
    section.lines.push(format!(
        "a = 0 and a = {:.0} µm draw one and the same trace ({:.0e} µm apart, {} µm rms from the readings) with different errors. Of the {n} the circle determines {seen}{imprecise}; the others, marked ×, are numbers of the method and not of the machine.",
        OTHER_MM * 1e3,
        found.apart_mm * 1e3,
        um(found.left_mm)
    ));
    section
        .lines
        .extend(found.fourteen.as_ref().map(|two| fourteen(found, two)));
    let component = |compared: &Compared| match compared.unknown {
        Unknown::Power { component, .. } | Unknown::Knot { component, .. } => Some(component),
        _ => None,
    };
    section
        .lines
        .extend(geometry::signs(found.unknowns.iter().filter_map(component)));
    let rows = found.unknowns.iter().map(|compared| {
        vec![
            compared.unknown.to_string(),
            format!("{}{}", um(compared.published_mm), mark(compared)),
            expanded(compared),
            format!("{}{}", um(compared.other_mm), mark(compared)),
            of_fourteen(compared, 0),
            of_fourteen(compared, 1),
            verdict(compared).to_owned(),
            of_all(compared).map_or_else(|| "—".to_owned(), in_words),
        ]
    });
    section.tables.push(Rows {
        head: head(&[
            "coefficient × distance / µm",
            "published, a = 0",
            "± U (k = 2)",
            "published, other a",
            "14 stations",
            "14 others",
            "this circle",
            "all recordings, ± U (k = 2)",
        ]),
        rows: rows.collect(),
        note: "Each number is a coefficient times the greatest distance of the circle from the machine's origin along the axis, to its power (the radius, where the circle is about the origin); a turn once more times that distance. It is the error at that distance on the positive side; on the negative side odd powers have the other sign. U of a published value: what is left of the trace, over the stations; ~: it exceeds the value. The last column is what all recordings of the bag determine, at the height of the plate; a dash: not even they. A squareness is that of the tangents where both axes are at zero, a number of this model; that of ISO 230-1 between reference lines stands with the geometric errors.".to_owned(),
    });
    section.figures = figures((run, &section.title), found, of_all);
    section
}

/// How far two choices of 14 stations are apart.
fn fourteen(found: &Comparison, two: &Fourteen) -> String {
    format!(
        "Any 14 of the {} stations, as the source takes them: every {:.1}th from the first, and the same from half a spacing later. The two choices print errors up to {} µm apart; their traces are up to {} µm apart.",
        found.n_stations,
        found.n_stations as f64 / 14.0,
        um(two.apart_mm),
        um(two.traces_apart_mm)
    )
}

/// What one choice of 14 stations prints.
fn of_fourteen(compared: &Compared, choice: usize) -> String {
    let value_mm = compared.fourteen_mm.map(|both| both[choice]);
    value_mm.map_or_else(
        || "—".to_owned(),
        |value_mm| format!("{}{}", um(value_mm), mark(compared)),
    )
}

fn is_seen(compared: &Compared) -> bool {
    compared.visibility == Visibility::Estimable
}

/// Whether the circle determines a value that is smaller than its own U.
fn is_below_u(compared: &Compared) -> bool {
    let u_mm = COVERAGE * compared.standard_uncertainty_mm;
    is_seen(compared) && u_mm > compared.published_mm.abs()
}

fn mark(compared: &Compared) -> &'static str {
    match (is_seen(compared), is_below_u(compared)) {
        (false, _) => " ×",
        (true, true) => " ~",
        (true, false) => "  ",
    }
}

/// U of a published value that the circle determines.
fn expanded(compared: &Compared) -> String {
    if !is_seen(compared) {
        return "—".to_owned();
    }
    um(COVERAGE * compared.standard_uncertainty_mm)
}

fn verdict(compared: &Compared) -> &'static str {
    match compared.visibility {
        Visibility::Estimable if is_below_u(compared) => "smaller than its U",
        Visibility::Estimable => "determined",
        Visibility::Mixed => "only in sums",
        Visibility::Unseen => "not at all",
    }
}

fn in_words(together: Together) -> String {
    let (value, u) = rounded(
        together.value_mm * 1e3,
        COVERAGE * together.standard_uncertainty_mm * 1e3,
    );
    format!("{value} ± {u}")
}

/// The turn about the normal of a plane.
fn normal(plane: TestPlane) -> Option<Axis> {
    match plane {
        TestPlane::Xy => Some(Axis::C),
        TestPlane::Yz => Some(Axis::A),
        TestPlane::Zx => Some(Axis::B),
        TestPlane::None => None,
    }
}

/// The unknown in a model of all recordings about the same origin: by itself, or as it acts at the height of
/// the plate, where the tilts of the same motions are in it.
fn together(model: &GeometryModel, compared: &Compared, normal: Axis) -> Option<Together> {
    let Unknown::Power { component, power } = compared.unknown else {
        return None;
    };
    let all = coefficients(model);
    let wanted = all.iter().position(|c| {
        c.curve.component == component && c.power() == power && c.curve.origin.abs() < 1e-9
    })?;
    if all[wanted].is_known() {
        let (curve, place) = (all[wanted].curve, all[wanted].place);
        return Some(Together {
            value_mm: curve.coefficient.get(place)? / compared.scale,
            standard_uncertainty_mm: curve.standard_uncertainty.get(place)? / compared.scale,
        });
    }
    let is_tilt = |idx: u32| {
        let other = all.get(idx as usize).map(|c| c.curve.component);
        other.is_some_and(|other| other.is_angular() && other.direction != normal)
    };
    model.combinations.iter().find_map(|sum| {
        let own = sum
            .weights
            .iter()
            .find(|(idx, _)| *idx as usize == wanted)?;
        let mut others = sum
            .weights
            .iter()
            .filter(|(idx, _)| *idx as usize != wanted);
        let factor = own.1 * compared.scale;
        others.all(|(idx, _)| is_tilt(*idx)).then(|| Together {
            value_mm: sum.value_mm / factor,
            standard_uncertainty_mm: sum.standard_uncertainty_mm / factor.abs(),
        })
    })
}

fn figures(
    (run, title): (u32, &str),
    found: &Comparison,
    of_all: &dyn Fn(&Compared) -> Option<Together>,
) -> serde_json::Value {
    let unknown = |compared: &Compared| {
        serde_json::json!({
            "name": compared.unknown.to_string(),
            "published_mm": compared.published_mm,
            "standard_uncertainty_mm": is_seen(compared).then_some(compared.standard_uncertainty_mm),
            "published_other_mm": compared.other_mm,
            "fourteen_stations_mm": compared.fourteen_mm,
            "determined_by_the_circle": is_seen(compared),
            "all_recordings": of_all(compared),
        })
    };
    serde_json::json!({
        "test": title,
        "published": {
            "run": run,
            "stations": found.n_stations,
            "readings_per_station": found.readings_per_station,
            "fourteen": found.fourteen.as_ref().map(|two| serde_json::json!({
                "stations": two.stations,
                "apart_mm": two.apart_mm,
                "traces_apart_mm": two.traces_apart_mm,
            })),
            "rank": found.rank,
            "other_u_mm": OTHER_MM,
            "traces_apart_mm": found.apart_mm,
            "left_mm": found.left_mm,
            "unknowns": found.unknowns.iter().map(unknown).collect::<Vec<_>>(),
        },
    })
}

#[cfg(test)]
mod tests {
    use grid_encoder::recording::{GridPoint, Place, Recording};
    use machine::Kinematics;
    use metrology::PerAxis;
    use nalgebra::Vector3;

    use super::*;

    /// A trace of 1 µm cos 7θ about a centre on Y, which no error of the model makes.
    fn circle(centre_y_mm: f64) -> StationCircle {
        let centre_mm = Vector3::new(0.0, centre_y_mm, 0.0);
        let place = Place::circle(TestPlane::Xy, centre_mm, 50.0, 360);
        let point = |k: u32| {
            let angle_rad = f64::from(k).to_radians();
            let positions = place.on_circle_mm(angle_rad);
            let off_mm = 1e-3 * (7.0 * angle_rad).cos();
            let [x_mm, y_mm] = [positions.0[0], positions.0[1]];
            GridPoint {
                positions,
                sense: Vector3::zeros(),
                velocity_mm_s: Vector3::zeros(),
                reading_mm: [
                    x_mm + off_mm * angle_rad.cos(),
                    y_mm + off_mm * angle_rad.sin(),
                ],
                standard_uncertainty_mm: [1e-4; 2],
                n_readings: 55,
            }
        };
        StationCircle {
            kinematics: Kinematics::of_chain(
                "[w X' Y' b Z t]".parse().unwrap(),
                PerAxis::default(),
            ),
            longest_rest: None,
            other_sense: None,
            recording: Recording {
                run: 29,
                points: (0..360).map(point).collect(),
                place,
            },
        }
    }

    #[test]
    fn val_numpy_a_value_below_its_u_is_marked_and_has_that_u() {
        // numpy: 2 s √G_jj of ECY3, s = 0.7171372 µm over 350 degrees of freedom; G_jj = 305.2978² off the origin, 1.1926² at it.
        for (centre_y_mm, expanded_um) in [(-150.0, 437.88), (0.0, 1.7105)] {
            let sections = sections(&circle(centre_y_mm), None);
            let section = &sections[0];
            let rows = &section.tables[0].rows;
            let row = rows.iter().find(|row| row[0] == "ECY3").unwrap();
            let found_um: f64 = row[2].parse().unwrap();
            assert!((found_um / expanded_um - 1.0).abs() < 5e-3, "{row:?}");
            assert!(row[1].ends_with('~'), "{row:?}");
            assert!(row.contains(&"smaller than its U".to_owned()), "{row:?}");
            let answer = section.lines.join(" ");
            assert!(answer.contains("with a U above the value (~)"), "{answer}");
            let alone = &sections[1].answers[0];
            assert!(
                alone.contains("with a U above the value, marked ~"),
                "{alone}"
            );
            let note = &section.tables[0].note;
            assert!(note.contains("on the negative side odd powers have the other sign"));
        }
    }

    /// The circle in one sense, 1 or -1, on a machine whose X and Y lose 6 µm at a reversal: at once, or over an angle.
    fn run_in_sense(sense: f64, reversal_rad: f64) -> StationCircle {
        let mut circle = circle(0.0);
        let place = circle.recording.place;
        for (k, point) in circle.recording.points.iter_mut().enumerate() {
            let angle_rad = (k as f64 + 0.5).to_radians();
            let (sin, cos) = angle_rad.sin_cos();
            point.positions = place.on_circle_mm(angle_rad);
            // 0.1 µm of noise, of no order along the circle.
            let noise_mm = 1e-4 * ((k * 7919 % 360) as f64 / 180.0 - 1.0);
            for (axis, moves) in [-sense * sin, sense * cos].into_iter().enumerate() {
                let since_rad = moves.abs().asin();
                let lost = 1.0 - 2.0 * (-since_rad / reversal_rad).exp();
                point.sense[axis] = moves.signum();
                point.reading_mm[axis] =
                    point.positions.0[axis] - 0.003 * moves.signum() * lost + noise_mm;
            }
        }
        circle
    }

    /// numpy, `tests/validation/one_circle_two_senses.py`, counter-clockwise.
    fn is_as_numpy_has_it(figures: &serde_json::Value) {
        for (name, right_um) in [("EYX3 − EC0Y", 6.1765), ("EXY3 − EYX3 − ECY2", -12.3341)] {
            let sums = figures["geometry"]["combinations"].as_array().unwrap();
            let sum = sums.iter().find(|sum| sum["sum"] == name).unwrap();
            let found_um = sum["value_mm"].as_f64().unwrap() * 1e3;
            assert!(
                (found_um / right_um - 1.0).abs() < 1e-2,
                "{name}: {found_um}"
            );
        }
    }

    #[test]
    fn val_numpy_a_circle_in_the_other_sense_contradicts_sums_where_lost_motion_is_no_step() {
        for (reversal_rad, is_step) in [(1e-6, true), (0.3, false)] {
            let [mut circle, mut other] = [1.0, -1.0].map(|t| run_in_sense(t, reversal_rad));
            other.recording.run = 30;
            circle.other_sense = Some(other.recording);
            let alone = &sections(&circle, None)[1];
            if !is_step {
                is_as_numpy_has_it(&alone.figures);
            }
            let lines = alone.lines.join(" ");
            let words = "run 30, the same circle in the other sense, contradicts";
            assert_eq!(lines.contains(words), !is_step, "{reversal_rad}: {lines}");
            let note = &alone.tables[0].note;
            assert!(note.contains("its certificate, heat"), "{note}");
            assert!(
                !note.contains("was given the plate's certificate"),
                "{note}"
            );
        }
    }
}
