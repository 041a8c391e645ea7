//! ISO 230-10: form and size of spheres, rings and bosses as the probe finds them, against their certificates.

use iso230::ExpandedLength;
use iso230::budget::DeviceUncertainty;
use iso230::probing::{self, Artefact, FormResult, RING_POINTS, SPHERE_POINTS, Side};
use machine::cycle::FeatureId;
use machine::file::CertificateEntry;
use metrology::fit::plane_basis;
use metrology::sample::{FeatureKind, ProbedFeature, ProbedPoint, Rejection};
use metrology::stamp::{Host, Stamp};
use nalgebra::{Vector2, Vector3};
use serde::Serialize;
use serde_json::json;

use super::slips::{far, slip};
use super::{drift_mm, is_list, kind, lists, pose};
use crate::evaluate::Tests;
use crate::evaluate::budget::Budget;
use crate::evaluate::correction::{About, Measured};
use crate::positioning::figure;
use crate::section::{NOT_EVALUATED, Rows, Section, head, um};

/// Why no conformance is decided of a size.
const SIZE_NOT_AT_20_DEGC: &str =
    "not corrected to 20 °C: temperature and expansion of the artefact are not stated";

/// One round shape, evaluated.
#[derive(Serialize)]
struct Found {
    feature: String,
    run: u32,
    kind: &'static str,
    pose: String,
    points: usize,
    usual_points: usize,
    /// P_FTU,2D or P_FTU,3D; without a certificate the artefact's own form is in it and not in its uncertainty.
    probing_error_mm: f64,
    probing_error: Option<ExpandedLength>,
    size_error: Option<ExpandedLength>,
    certificate: Option<String>,
    not_evaluated: Option<String>,
    /// Whether one of its touches is of something else.
    #[serde(skip)]
    has_slip: bool,
    /// A touch far from the others, which every figure counts.
    #[serde(skip)]
    far: Option<String>,
}

/// A ring whose axis (a unit vector) is nearer to Z is evaluated in X and Y: its radii differ by less than 1e-4 of themselves.
const LEAST_TILT: f64 = 1e-2;

/// The part, where a round shape was touched.
pub(super) fn section(tests: &Tests, budget: Option<&Budget>) -> Option<Section> {
    let mut before: Vec<(&ProbedFeature, Stamp<Host>)> = vec![];
    let mut found = vec![];
    for feature in tests
        .features
        .iter()
        .filter(|f| f.kind != FeatureKind::Plane)
    {
        let same = |(known, _): &&(&ProbedFeature, Stamp<Host>)| {
            known.run == feature.run && known.feature_id == feature.feature_id
        };
        let since = before.iter().rev().find(same).map(|(_, at)| *at);
        found.push(evaluated(tests, feature, since, budget));
        before.push((feature, feature.at));
    }
    (!found.is_empty()).then(|| {
        let mut section = Section::new("Probing errors of form and size, ISO 230-10");
        let all = match is_list(tests) {
            true => answers_of_list(&found),
            false => answers(&found, budget.is_some()),
        };
        for answer in all {
            section.answer(answer);
        }
        for (is_warning, line) in reasons(&found, tests) {
            if is_warning {
                section.warn(NOT_EVALUATED, line);
            } else {
                section.lines.push(line);
            }
        }
        let slipped = found.iter().find(|one| one.has_slip);
        section.unevaluated = slipped.and_then(|one| one.not_evaluated.clone());
        let far: Vec<String> = found.iter().filter_map(|one| one.far.clone()).collect();
        section.name_far(&far);
        section.tables.push(Rows {
            head: head(&[
                "feature",
                "points",
                "usual",
                "P_FTU / µm",
                "size error / µm",
                "certificate",
            ]),
            rows: found.iter().map(|one| one.row(budget.is_some())).collect(),
            note: note(budget.is_some()),
        });
        section.figures = json!({
            "test": section.title, "iso230_10_errors": found, "no_verdict_on_size": SIZE_NOT_AT_20_DEGC,
        });
        if is_list(tests) {
            let good = found.iter().filter(|one| one.not_evaluated.is_none());
            let error = |one: &'_ Found| vec![("probing_error", one.probing_error_mm)];
            let all = good.map(|one| (one.feature.as_str(), error(one)));
            section.figures["iso230_10_list"] = lists::by_feature(all);
        }
        section
    })
}

fn note(stated: bool) -> String {
    let uncertainty = if stated {
        " ± expanded uncertainty, k = 2: certificate, drift, and temperature and expansion of `machine` of the budget."
    } else {
        " Without --budget no uncertainty is stated."
    };
    format!(
        "P_FTU,3D of a sphere, P_FTU,2D of a bore or boss: greatest minus least distance from the centre that all touches have with one weight. Size error: measured diameter minus that of the certificate, {SIZE_NOT_AT_20_DEGC}; no conformance of it is decided.{uncertainty}"
    )
}

/// The probing error of each artefact that was touched as often as the standard asks, of several measurements the greatest.
fn answers(found: &[Found], stated: bool) -> Vec<String> {
    let mut greatest: Vec<(&str, &Found, &ExpandedLength)> = vec![];
    for one in found.iter().filter(|one| one.points == one.usual_points) {
        let Some(error) = &one.probing_error else {
            continue;
        };
        match greatest
            .iter_mut()
            .find(|(known, ..)| *known == one.feature)
        {
            Some(entry) if entry.2.value_mm < error.value_mm => *entry = (&one.feature, one, error),
            Some(_) => {}
            None => greatest.push((&one.feature, one, error)),
        }
    }
    let in_words = |(feature, one, error): (&str, &Found, &ExpandedLength)| {
        let name = if one.kind == "sphere" {
            "P_FTU,3D"
        } else {
            "P_FTU,2D"
        };
        let coverage = if stated { " (k = 2)" } else { "" };
        format!(
            "{name} {} µm{coverage}, of {} points on {feature}, run {}.",
            figure(error, stated),
            one.points,
            one.run
        )
    };
    greatest.into_iter().map(in_words).collect()
}

/// The greatest probing error of each artefact of a list, however often it was touched.
fn answers_of_list(found: &[Found]) -> Vec<String> {
    let mut greatest: Vec<&Found> = vec![];
    for one in found.iter().filter(|one| one.not_evaluated.is_none()) {
        let known = greatest
            .iter_mut()
            .find(|known| known.feature == one.feature);
        match known {
            Some(known) if known.probing_error_mm < one.probing_error_mm => *known = one,
            Some(_) => {}
            None => greatest.push(one),
        }
    }
    let in_words = |one: &&Found| {
        let name = if one.kind == "sphere" {
            "P_FTU,3D"
        } else {
            "P_FTU,2D"
        };
        let asked = match one.points == one.usual_points {
            true => String::new(),
            false => format!("; ISO 230-10 asks for {}", one.usual_points),
        };
        format!(
            "{name} {} µm, of {} points on {}, run {}{asked}.",
            um(one.probing_error_mm),
            one.points,
            one.feature,
            one.run
        )
    };
    greatest.iter().map(in_words).collect()
}

/// What has no figure, each reason once, with whether the whole test has none.
fn reasons(found: &[Found], tests: &Tests) -> Vec<(bool, String)> {
    let mut lines: Vec<(bool, String)> = vec![];
    let mut add = |is_warning: bool, line: String| {
        if !lines.iter().any(|(_, known)| *known == line) {
            lines.push((is_warning, line));
        }
    };
    for one in found {
        match &one.not_evaluated {
            Some(why) => add(
                true,
                format!("{}, run {}: not evaluated: {why}.", one.feature, one.run),
            ),
            None if one.certificate.is_none() => {
                let where_missing = if tests.machine.is_some() {
                    "the machine file has no certificate of it (certificates)"
                } else if is_list(tests) {
                    "a list has no certificate of it"
                } else {
                    "the bag has no machine file, which would have its certificate"
                };
                add(
                    false,
                    format!(
                        "{}: {where_missing}: no size error, and its own form is in P_FTU.",
                        one.feature
                    ),
                );
            }
            None => {}
        }
        if one.points != one.usual_points {
            let line = format!(
                "{}, a {}: {} points; the standard asks for {}.",
                one.feature, one.kind, one.points, one.usual_points
            );
            add(false, line);
        }
    }
    lines
}

/// The used touches of one shape: those of its run and name since the shape before.
fn points(tests: &Tests, feature: &ProbedFeature, since: Option<Stamp<Host>>) -> Vec<Vector3<f64>> {
    let is_of = |point: &ProbedPoint| {
        let owner = FeatureId::parse(&point.feature_id).map(|id| id.owner() == feature.feature_id);
        owner == Some(true)
            && point.rejection == Rejection::None
            && point.received_at <= feature.at
            && since.is_none_or(|since| point.received_at > since)
    };
    let touches = tests.touches.iter();
    touches
        .filter(|(segment, point)| segment.run == feature.run && is_of(point))
        .map(|(_, point)| point.point_in_machine_mm)
        .collect()
}

/// The artefact as its certificate states it; without one, as large as it was found.
fn artefact(
    tests: &Tests,
    feature: &ProbedFeature,
    certificate: Option<&CertificateEntry>,
    budget: Option<&Budget>,
) -> Artefact {
    let runs = [feature.run];
    let expansion = Measured::of(tests, budget, About::lengths(&runs))
        .budget
        .machine;
    let device = |expanded_um: f64, coverage_factor: f64| DeviceUncertainty {
        expanded_uncertainty_mm: expanded_um * 1e-3,
        expanded_uncertainty_per_length: 0.0,
        coverage_factor,
    };
    let mut artefact = Artefact {
        diameter_mm: 2.0 * feature.radius_mm,
        diameter_uncertainty: device(0.0, 1.0),
        form_mm: 0.0,
        form_standard_uncertainty_mm: 0.0,
        expansion,
        // Points are of the surface: the probe has taken the ball off.
        stylus_radius_mm: 0.0,
        side: if feature.kind == FeatureKind::Bore {
            Side::Inside
        } else {
            Side::Outside
        },
    };
    if let Some(stated) = certificate {
        artefact.diameter_mm = stated.diameter_mm;
        artefact.diameter_uncertainty =
            device(stated.expanded_uncertainty_um, stated.coverage_factor);
        artefact.form_mm = stated.form_um * 1e-3;
        artefact.form_standard_uncertainty_mm =
            stated.form_expanded_uncertainty_um * 1e-3 / stated.coverage_factor;
    }
    artefact
}

fn evaluated(
    tests: &Tests,
    feature: &ProbedFeature,
    since: Option<Stamp<Host>>,
    budget: Option<&Budget>,
) -> Found {
    let points = points(tests, feature, since);
    let machine = tests.machine.as_ref();
    let certificate = machine.and_then(|file| file.certificate(&feature.feature_id));
    let is_sphere = feature.kind == FeatureKind::Sphere;
    let artefact = artefact(tests, feature, certificate, budget);
    let drift_mm = drift_mm(budget);
    let of = |points: &[Vector3<f64>]| {
        if is_sphere {
            return probing::sphere(points, &artefact, drift_mm);
        }
        let flat: Vec<_> = points.iter().map(|point| flat(point, feature)).collect();
        probing::ring(&flat, &artefact, drift_mm)
    };
    let form_mm = |points: &[Vector3<f64>]| of(points).ok().map(|one| one.form_error.value_mm);
    // A centre and a radius.
    let n_unknowns = if is_sphere { 4 } else { 3 };
    let slip = slip(&points, n_unknowns, form_mm);
    let far = far(&points, n_unknowns, form_mm).filter(|_| slip.is_none());
    let (why, result) = match (of(&points), &slip) {
        (Ok(_), Some(why)) => (Some(why.clone()), None),
        (Ok(result), None) => (None, Some(result)),
        (Err(error), _) => (Some(error.to_string()), None),
    };
    let stated = |of: fn(&FormResult) -> ExpandedLength| {
        let known = certificate.and(result.as_ref());
        known.map(of)
    };
    Found {
        feature: feature.feature_id.clone(),
        run: feature.run,
        kind: kind(feature),
        pose: pose(feature),
        points: points.len(),
        usual_points: if is_sphere {
            SPHERE_POINTS
        } else {
            RING_POINTS
        },
        probing_error_mm: { result.as_ref() }.map_or(f64::NAN, |one| one.form_error.value_mm),
        probing_error: stated(|one| one.form_error),
        // Positions of a list have the ball's radius in them.
        size_error: stated(|one| one.size_error).filter(|_| !is_list(tests)),
        certificate: certificate.map(|one| one.number.clone().unwrap_or_default()),
        not_evaluated: why,
        has_slip: slip.is_some(),
        far: far.map(|far| format!("{}, run {}: {far}", feature.feature_id, feature.run)),
    }
}

/// A point in the plane of a ring; without a normal of its own that of X and Y.
fn flat(point: &Vector3<f64>, feature: &ProbedFeature) -> Vector2<f64> {
    let tilt = feature.normal.xy().norm();
    if tilt <= LEAST_TILT || feature.normal.norm() < 0.5 {
        return point.xy();
    }
    let [across, along] = plane_basis(&feature.normal);
    Vector2::new(point.dot(&across), point.dot(&along))
}

impl Found {
    fn row(&self, stated: bool) -> Vec<String> {
        let size = self.size_error.as_ref();
        let form = self.probing_error.as_ref();
        vec![
            format!("{}, run {}{}", self.feature, self.run, self.pose),
            self.points.to_string(),
            self.usual_points.to_string(),
            form.map_or_else(|| um(self.probing_error_mm), |one| figure(one, stated)),
            size.map_or_else(|| um(f64::NAN), |one| figure(one, stated)),
            match self.certificate.as_deref() {
                None => "none".to_owned(),
                Some("") => "without number".to_owned(),
                Some(number) => number.to_owned(),
            },
        ]
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use machine::MachineFile;
    use metrology::sample::{Correction, TestKind, TestSegment};
    use metrology::{AxisSet, PerAxis};
    use nalgebra::Matrix3;

    use super::*;

    /// 25 points with three lobes and noise, evaluated by scipy.
    const REFERENCE: &str =
        include_str!("../../../../libraries/iso230/tests/data/iso230_reference.json");
    const MACHINE: &str = include_str!("../../../../../launch_configs/five_axis/machine.yaml");
    const BUDGET: &str = "
grid_encoder: {expanded_uncertainty_um: 0.6, expanded_uncertainty_um_per_m: 1.0, coverage_factor: 2.0}
length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {temperature_deviation_k: 0.5, temperature_half_width_k: 0.5, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}
device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.1
environmental_drift_um: 0.6
";

    fn reference(name: &str) -> serde_json::Value {
        let all: serde_json::Value = serde_json::from_str(REFERENCE).unwrap();
        all["sphere"][name].clone()
    }

    fn segment() -> TestSegment {
        TestSegment {
            feed_mm_s: 2.0,
            zero_id: 1,
            setup_id: 1,
            features: vec!["high".to_owned()],
            completed: false,
            ..TestSegment::of_kind(TestKind::Sphere, 4, Stamp::from_nanos(0))
        }
    }

    fn touch(index: usize, point_mm: [f64; 3]) -> ProbedPoint {
        ProbedPoint {
            received_at: Stamp::from_nanos(index as i64 + 1),
            feature_id: format!("high.{}", index + 1),
            axes_at_contact: PerAxis::default(),
            axes: AxisSet::XYZ,
            point_in_machine_mm: point_mm.into(),
            point_in_workpiece_mm: Vector3::zeros(),
            applied_latency_s: 0.0,
            correction: Correction::None,
            standard_uncertainty_mm: 0.0,
            approach: -Vector3::z(),
            feed_mm_s: 2.0,
            rejection: Rejection::None,
            sequence: 0,
        }
    }

    /// A bag with the 25 touches, two of another sphere and one that was rejected.
    fn tests(certificate: &str) -> Tests {
        let points: Vec<[f64; 3]> = serde_json::from_value(reference("points_mm")).unwrap();
        let n = points.len();
        let mut touches: Vec<ProbedPoint> = { points.into_iter().enumerate() }
            .map(|(index, point)| touch(index, point))
            .collect();
        let mut rejected = touch(0, [99.0; 3]);
        rejected.rejection = Rejection::Gap;
        let mut other = touch(1, [50.0; 3]);
        other.feature_id = "low.1".to_owned();
        touches.extend([rejected, other]);
        let radius_mm: f64 = serde_json::from_value(reference("radius_mm")).unwrap();
        let feature = ProbedFeature {
            at: Stamp::from_nanos(n as i64),
            feature_id: "high".to_owned(),
            kind: FeatureKind::Sphere,
            centre_mm: Vector3::zeros(),
            centre_covariance_mm2: Matrix3::zeros(),
            normal: Vector3::zeros(),
            normal_standard_uncertainty_rad: f64::NAN,
            radius_mm,
            radius_standard_uncertainty_mm: 0.0,
            form_mm: 0.0,
            n: n as u32,
            n_rejected: 1,
            run: 4,
            rotary_axes: AxisSet::default(),
            rotary_rad: PerAxis::default(),
        };
        // With certificates of the test alone.
        let bare = MACHINE.split("certificates:").next().unwrap_or(MACHINE);
        let large = bare.replacen("radius_mm: 12.5", "radius_mm: 15.0", 1);
        let machine = MachineFile::parse(&format!("{large}{certificate}"), "machine.yaml").unwrap();
        Tests {
            touches: touches.into_iter().map(|one| (segment(), one)).collect(),
            features: vec![feature],
            machine: Some(machine),
            ..Tests::default()
        }
    }

    #[test]
    fn val_form_and_size_of_25_touches_are_those_of_scipy_with_the_certificates_uncertainty() {
        let certificate = "certificates:\n  - {artefact: high, diameter_mm: 30.0006, expanded_uncertainty_um: 0.4, form_um: 0.3, form_expanded_uncertainty_um: 0.1, coverage_factor: 2.0, number: K-17}\n";
        let budget = Budget::read(BUDGET, Path::new("budget.yaml")).unwrap();
        let section = section(&tests(certificate), Some(&budget)).unwrap();
        let why = section.figures["no_verdict_on_size"].as_str().unwrap();
        assert!(why.starts_with("not corrected to 20 °C"), "{why}");
        assert!(section.tables[0].note.contains(why), "{:?}", section.tables);
        let one = &section.figures["iso230_10_errors"][0];
        let value = |key: &str, of: &str| one[key][of].as_f64().unwrap() * 1e3;
        let by_scipy = |name: &str| reference(name).as_f64().unwrap();
        let near =
            |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
        near(
            value("probing_error", "value_mm"),
            by_scipy("form_mm") * 1e3,
        );
        let size_um = (2.0 * by_scipy("radius_mm") - 30.0006) * 1e3;
        near(value("size_error", "value_mm"), size_um);
        // By hand, µm: one touch drifts by ±0.3 (rectangular), form 0.3 with 0.05; 30 mm with 11 µm/m/K to 0.5 K and
        // 0.5 K with 1 µm/m/K.
        let drift2 = 0.3 * 0.3 / 3.0;
        // The fit of 4 unknowns takes its part of 25 touches; each of two touches lies anywhere within the form.
        let form = 2.0 * f64::sqrt(2.0 * drift2 * 21.0 / 25.0 + (0.3 * 0.3 + 0.05 * 0.05) / 6.0);
        near(value("probing_error", "expanded_uncertainty_mm"), form);
        let warm2 = (0.03_f64 * 11.0 * 0.5).powi(2) / 3.0 + (0.03_f64 * 0.5).powi(2) / 3.0;
        // Variance factor of the radius, numpy: inverse of the normal matrix of (direction, 1) at the scipy centre.
        let of_radius = 0.107_400_375_8;
        let size = 2.0 * f64::sqrt(0.2 * 0.2 + warm2 + 4.0 * of_radius * drift2);
        let stated = value("size_error", "expanded_uncertainty_mm");
        assert!((stated - size).abs() < 1e-5, "{stated} {size}");
        assert!(
            section.terminal().contains("K-17"),
            "{}",
            section.terminal()
        );
        let scipy_um = by_scipy("form_mm") * 1e3;
        let answer =
            format!("P_FTU,3D {scipy_um:.2} ± {form:.2} µm (k = 2), of 25 points on high, run 4.");
        assert_eq!(section.answers, [answer]);
        assert!(section.warnings.is_empty());
    }

    #[test]
    fn without_a_certificate_there_is_the_form_and_the_reason_why_there_is_no_size() {
        let section = section(&tests(""), None).unwrap();
        let one = &section.figures["iso230_10_errors"][0];
        assert!(one["size_error"].is_null() && one["probing_error"].is_null());
        let form = one["probing_error_mm"].as_f64().unwrap();
        assert!((form - reference("form_mm").as_f64().unwrap()).abs() < 1e-9);
        let why = "high: the machine file has no certificate of it (certificates): no size error, and its own form is in P_FTU.";
        assert_eq!(section.lines, [why]);
    }

    #[test]
    fn a_touch_that_is_not_of_the_shape_takes_its_figure_away_by_name() {
        let sphere = |k: u32| {
            let (turn, tilt) = (f64::from(k) * 2.399, f64::from(k) / 25.0 * 1.5);
            12.5 * Vector3::new(turn.cos() * tilt.sin(), turn.sin() * tilt.sin(), tilt.cos())
        };
        let form_mm = |points: &[Vector3<f64>]| {
            let radii = points.iter().map(|point| point.norm());
            Some(radii.clone().fold(0.0, f64::max) - radii.fold(f64::INFINITY, f64::min))
        };
        let mut points: Vec<Vector3<f64>> = (0..25).map(sphere).collect();
        assert_eq!(slip(&points, 4, form_mm), None);
        assert_eq!(far(&points, 4, form_mm), None);
        let sound = points[17];
        points[17] *= 1.008;
        assert_eq!(slip(&points, 4, form_mm), None);
        let named = far(&points, 4, form_mm).unwrap();
        let words = "touch 18 of 25 makes the form error 100.00 µm, which is 0.00 µm without it";
        assert!(named.starts_with(words), "{named}");
        points[17] = sound;
        points[17].x = 0.0;
        let few = slip(&points[14..20], 4, form_mm).unwrap();
        assert!(few.contains("one of its 6 touches"), "{few}");
        let said = slip(&points, 4, form_mm).unwrap();
        assert!(said.contains("touch 18 of 25, at (0, "), "{said}");
    }
}
