//! Tool error against the plant's truth at the poses of each verification, as a whole and as a part on the machine has it.
//!
//! A part is set up on the machine itself: its datum takes out what shifts and turns all poses together.
//!
//! ```text
//!   e_k = s + w x p_k + r_k,   sum |r_k|^2 least over s and w            (1)
//! ```
//!
//! Nor can a plate that is put on the table see s and w, so that it is r that a volumetric compensation must make small.

use nalgebra::{DMatrix, DVector, Vector3};

use super::screen::{OF_THE_PLANT, Screen, Tile, Tone, compensated};
use super::section::{Rows, Section, head, um};
use super::svg::short;
use super::vectors::{self, Field};
use crate::evidence::Verification;

/// Sizes of the errors, or of what (1) leaves of them, ascending, mm.
fn sizes_mm(verification: &Verification, aligned: bool) -> Vec<f64> {
    let poses = &verification.poses;
    let mut sizes: Vec<f64> = match aligned.then(|| residuals_mm(verification)).flatten() {
        Some(residuals) => residuals.iter().map(Vector3::norm).collect(),
        None if aligned => Vec::new(),
        None => poses.iter().map(|pose| pose.error_mm.norm()).collect(),
    };
    sizes.sort_by(f64::total_cmp);
    sizes
}

/// r of (1); `None` with fewer than three poses, or poses on one line.
fn residuals_mm(verification: &Verification) -> Option<Vec<Vector3<f64>>> {
    let poses = &verification.poses;
    let n = poses.len();
    if n < 3 {
        return None;
    }
    let design = DMatrix::from_fn(3 * n, 6, |row, column| {
        let (pose, axis) = (&poses[row / 3], row % 3);
        let unit = Vector3::ith(column % 3, 1.0);
        if column < 3 {
            unit[axis]
        } else {
            unit.cross(&pose.commanded_mm)[axis]
        }
    });
    let errors = DVector::from_fn(3 * n, |row, _| poses[row / 3].error_mm[row % 3]);
    let svd = design.clone().svd(true, true);
    if svd.rank(svd.singular_values.max() * 1e-9) < 6 {
        return None;
    }
    let fit = svd.solve(&errors, 0.0).ok()?;
    let left = errors - design * fit;
    Some(
        (0..n)
            .map(|k| Vector3::new(left[3 * k], left[3 * k + 1], left[3 * k + 2]))
            .collect(),
    )
}

/// Size that `share` of the poses do not exceed, mm; NaN without poses.
fn quantile_mm(sizes_mm: &[f64], share: f64) -> f64 {
    let place = (share * sizes_mm.len() as f64).ceil() as usize;
    let last = sizes_mm.len().saturating_sub(1);
    sizes_mm
        .get(place.saturating_sub(1).min(last))
        .copied()
        .unwrap_or(f64::NAN)
}

/// The part, where a verification was seen.
#[must_use]
pub fn section(verifications: &[Verification]) -> Option<Section> {
    let seen: Vec<&Verification> = verifications
        .iter()
        .filter(|v| !v.poses.is_empty())
        .collect();
    if seen.is_empty() {
        return None;
    }
    let mut section = Section::new("Tool error at the poses of each verification");
    let find = |word: &str| seen.iter().rev().find(|v| v.label.contains(word));
    if let (Some(without), Some(with)) = (find("without"), find("with compensation")) {
        for (aligned, what) in [
            (false, "as it stands"),
            (true, "about a datum set on the machine"),
        ] {
            let p95_mm = |verification| quantile_mm(&sizes_mm(verification, aligned), 0.95);
            let (before_mm, after_mm) = (p95_mm(without), p95_mm(with));
            section.answer(format!(
                "p95 {what}: {} µm without compensation, {} µm with it ({:.1}-fold less), {} poses.",
                um(before_mm),
                um(after_mm),
                before_mm / after_mm,
                with.poses.len()
            ));
        }
    } else {
        let p95 = seen.iter().map(|verification| {
            let p95_mm = quantile_mm(&sizes_mm(verification, false), 0.95);
            format!("{} µm ({})", um(p95_mm), verification.label)
        });
        let p95: Vec<String> = p95.collect();
        section.answer(format!("p95: {}.", p95.join(", ")));
    }
    let rows = seen.iter().map(|verification| {
        vec![
            verification.label.clone(),
            verification.poses.len().to_string(),
            um(quantile_mm(&sizes_mm(verification, false), 0.95)),
            um(quantile_mm(&sizes_mm(verification, false), 1.0)),
            um(quantile_mm(&sizes_mm(verification, true), 0.5)),
            um(quantile_mm(&sizes_mm(verification, true), 0.95)),
            um(quantile_mm(&sizes_mm(verification, true), 1.0)),
        ]
    });
    section.tables.push(Rows {
        head: head(&[
            "verification / µm",
            "poses",
            "p95",
            "max",
            "median about datum",
            "p95 about datum",
            "max about datum",
        ]),
        rows: rows.collect(),
        note: note(&seen),
    });
    let figures: Vec<serde_json::Value> = seen.iter().map(|one| figures(one)).collect();
    section.figures = serde_json::json!({ "verifications": figures });
    Some(section)
}

/// What the table's columns are; those about a datum are left out of the page where no pose has one.
fn note(seen: &[&Verification]) -> String {
    let has_datum = |one: &&&Verification| quantile_mm(&sizes_mm(one, true), 0.5).is_finite();
    let datum = match seen.iter().find(has_datum) {
        Some(_) => {
            "; about a datum: the shift and turn that all poses share are taken out, as setting a part up does"
        }
        None => "",
    };
    format!(
        "Size of the true error of the tool relative to the workpiece, which the simulated plant knows and no node sees{datum}."
    )
}

/// The first screen of the last pair of verifications without and with compensation: of those that their labels name so, else
/// of those without and with offsets.
#[must_use]
pub fn screen(verifications: &[Verification]) -> Screen {
    let seen = || verifications.iter().filter(|v| !v.poses.is_empty());
    let find = |word: &str| seen().rfind(|v| v.label.contains(word));
    let acted = |wanted: bool| seen().rfind(|v| v.is_compensated == wanted);
    let p95_mm = |verification| quantile_mm(&sizes_mm(verification, false), 0.95);
    let n = |verification: &Verification| verification.poses.len();
    let (pair, what) = match (find("without"), find("with compensation")) {
        (Some(without), Some(with)) => ((without, with), format!("{} poses", n(with))),
        _ => match (acted(false), acted(true)) {
            (Some(without), Some(with)) if n(without) == n(with) => {
                let labels = format!("{}, {}", without.label, with.label);
                ((without, with), format!("{} poses: {labels}", n(with)))
            }
            _ => return unpaired(verifications),
        },
    };
    let mut screen = compensated(p95_mm(pair.0), p95_mm(pair.1), &what);
    screen.tiles.extend(about_datum(pair));
    screen.picture = picture(pair);
    screen
}

/// A tile of the last verification, where none was made without and with compensation.
fn unpaired(verifications: &[Verification]) -> Screen {
    let p95_um = |verification: &Verification| {
        short(quantile_mm(&sizes_mm(verification, false), 0.95) * 1e3)
    };
    let mut seen = verifications.iter().filter(|v| !v.poses.is_empty());
    let Some(last) = seen.next_back() else {
        return Screen::default();
    };
    let others = seen.map(|one| format!("; {}: {} µm", one.label, p95_um(one)));
    let n = last.poses.len();
    let more = format!(
        "p95 of {n} poses: {}{}; {OF_THE_PLANT}",
        last.label,
        others.collect::<String>()
    );
    Screen {
        tiles: vec![Tile::new(
            "tool error",
            format!("{} µm", p95_um(last)),
            more,
        )],
        ..Screen::default()
    }
}

/// The tool error about a datum without and with compensation, as a tile; `None` where poses have none.
fn about_datum((without, with): (&Verification, &Verification)) -> Option<Tile> {
    let p95_mm = |verification| quantile_mm(&sizes_mm(verification, true), 0.95);
    let (before_mm, after_mm) = (p95_mm(without), p95_mm(with));
    if !(before_mm.is_finite() && after_mm.is_finite()) {
        return None;
    }
    let is_less = after_mm < before_mm;
    let value = format!("{} → {} µm", short(before_mm * 1e3), short(after_mm * 1e3));
    let more = "p95; what a part has that is set up on the machine: shift and turn of all poses are taken out";
    Some(
        Tile::new("about a datum set on the machine", value, more).toned(if is_less {
            Tone::Good
        } else {
            Tone::Bad
        }),
    )
}

/// Error vectors about a datum over the volume, without and with compensation; `None` where the poses fill no volume.
fn picture((without, with): (&Verification, &Verification)) -> Option<maud::Markup> {
    let field = |verification: &Verification, name: &str| {
        let errors = residuals_mm(verification)?;
        let places = verification.poses.iter().map(|pose| pose.commanded_mm);
        Some(Field {
            name: name.to_owned(),
            arrows: places.zip(errors).collect(),
        })
    };
    let fields = [
        field(without, "without compensation")?,
        field(with, "with compensation")?,
    ];
    vectors::picture(
        &fields,
        "True error of the tool about a datum set on the machine",
    )
}

fn figures(verification: &Verification) -> serde_json::Value {
    serde_json::json!({
        "label": verification.label,
        "poses": verification.poses.len(),
        "p95_mm": quantile_mm(&sizes_mm(verification, false), 0.95),
        "max_mm": quantile_mm(&sizes_mm(verification, false), 1.0),
        "aligned_p95_mm": quantile_mm(&sizes_mm(verification, true), 0.95),
        "aligned_max_mm": quantile_mm(&sizes_mm(verification, true), 1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::PoseError;
    use metrology::Stamp;

    fn verification(label: &str, error: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Verification {
        let place = |k: i32| {
            let (x, y, z) = (k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
            Vector3::new(f64::from(x), f64::from(y), f64::from(z)) * 100.0
        };
        let pose = |k: i32| PoseError {
            commanded_mm: place(k),
            error_mm: error(place(k)),
        };
        Verification {
            label: label.to_owned(),
            at: Stamp::from_nanos(0),
            is_compensated: false,
            poses: (0..27).map(pose).collect(),
        }
    }

    #[test]
    fn eq1_takes_out_what_a_datum_takes_out_and_nothing_else() {
        let rigid = |p: Vector3<f64>| {
            Vector3::new(0.01, -0.02, 0.03) + Vector3::new(1e-5, 2e-5, -3e-5).cross(&p)
        };
        let moved = verification("without compensation", rigid);
        assert!(quantile_mm(&sizes_mm(&moved, true), 1.0) < 1e-12);
        assert!(quantile_mm(&sizes_mm(&moved, false), 1.0) > 0.03);
        let stretched = verification("with compensation", |p| {
            rigid(p) + Vector3::new(2e-5 * p.x, 0.0, 0.0)
        });
        assert!((quantile_mm(&sizes_mm(&stretched, true), 1.0) - 0.002).abs() < 1e-9);
        let section = section(&[moved.clone(), stretched.clone()]).unwrap();
        assert_eq!(section.lines.len(), 2, "{:?}", section.lines);
        assert!(section.tables[0].note.contains("about a datum"));
        let screen = super::screen(&[moved.clone(), stretched.clone()]);
        assert!(screen.verdict.is_some() && screen.picture.is_some());
        assert_eq!(screen.tiles[1].value, "0 → 2.00 µm");
        assert_eq!(screen.tiles[1].tone, Tone::Bad);
        let alone = super::screen(&[
            Verification {
                label: "cold".to_owned(),
                ..moved.clone()
            },
            Verification {
                label: "after 1 h".to_owned(),
                ..moved
            },
        ]);
        assert!(alone.verdict.is_none());
        let more = &alone.tiles[0].more;
        let words = "p95 of 27 poses: after 1 h; cold: ";
        assert!(more.starts_with(words), "{more}");
        assert!(more.ends_with("read by no instrument"), "{more}");
        let paired = &screen.tiles[0].more;
        assert!(paired.ends_with("read by no instrument"), "{paired}");
        let named = |label: &str, is_compensated| Verification {
            label: label.to_owned(),
            is_compensated,
            ..stretched.clone()
        };
        let pair = [
            named("semi-closed, warm", false),
            named("dual loop, warm", true),
        ];
        let (verdict, _) = super::screen(&pair).verdict.unwrap();
        assert!(
            verdict.contains("semi-closed, warm, dual loop, warm"),
            "{verdict}"
        );
        let (mut fewer, with) = pair.into();
        fewer.poses.pop();
        assert!(super::screen(&[fewer, with]).verdict.is_none());
        assert!(super::section(&[]).is_none());
    }

    #[test]
    fn poses_on_one_line_have_no_datum() {
        let mut line = verification("line", |_| Vector3::x());
        for pose in &mut line.poses {
            pose.commanded_mm.y = 0.0;
            pose.commanded_mm.z = 0.0;
        }
        assert!(residuals_mm(&line).is_none());
        let note = &section(&[line]).unwrap().tables[0].note;
        assert!(note.contains("the simulated plant knows"), "{note}");
        assert!(!note.contains("about a datum"), "{note}");
    }
}
