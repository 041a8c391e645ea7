//! Geometric errors as they were identified: what is known, how well, and what is not known.

use metrology::ErrorComponent;
use metrology::sample::{CurveForm, ErrorCurve, GeometryModel, PositioningTable};

use super::section::{Rows, Section, head, um};

/// One part for a model.
#[must_use]
pub fn section(title: &str, model: &GeometryModel) -> Section {
    let mut section = Section::new(title);
    section.lines.push(format!(
        "Chain {}; {} unknowns, rank {}, {} readings; standard deviation of the residuals {} µm.",
        model.chain,
        model.n_unknowns,
        model.rank,
        model.n_samples,
        um(model.residual_standard_deviation_mm)
    ));
    let mut rows = Vec::new();
    for curve in &model.curves {
        for place in 0..curve.coefficient.len() {
            rows.push(row(curve, place));
        }
    }
    section.tables.push(Rows {
        head: head(&["coefficient", "at the end of the span", "u", "known"]),
        rows,
        note: "A coefficient times the greatest recorded position to its power: µm for shifts, µrad for turns. A dash: the recordings do not determine it by itself.".to_owned(),
    });
    if !model.combinations.is_empty() {
        let names: Vec<String> = model.curves.iter().flat_map(names).collect();
        let rows = model.combinations.iter().map(|combination| {
            let mut terms: Vec<(f64, String)> = combination
                .weights
                .iter()
                .filter_map(|(idx, weight)| Some((*weight, names.get(*idx as usize)?.clone())))
                .collect();
            terms.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
            let words: Vec<String> = terms
                .iter()
                .map(|(weight, name)| format!("{weight:+.4e} {name}"))
                .collect();
            vec![
                words.join(" "),
                um(combination.value_mm),
                um(combination.standard_uncertainty_mm),
            ]
        });
        section.tables.push(Rows {
            head: head(&["known together (mm)", "value / µm", "u / µm"]),
            rows: rows.collect(),
            note: "Sums that the recordings determine although their members are not known."
                .to_owned(),
        });
    }
    section
}

fn names(curve: &ErrorCurve) -> Vec<String> {
    (0..curve.coefficient.len())
        .map(|place| name(curve, place))
        .collect()
}

fn name(curve: &ErrorCurve, place: usize) -> String {
    let component = curve.component;
    match curve.form {
        CurveForm::Constant => component.to_string(),
        CurveForm::Polynomial => {
            let power = curve.power.get(place).copied().unwrap_or(0);
            format!("{component}{power}")
        }
        CurveForm::Table => {
            let at = curve.position.get(place).copied().unwrap_or(f64::NAN);
            format!("{component} at {at:.1}")
        }
    }
}

fn row(curve: &ErrorCurve, place: usize) -> Vec<String> {
    let reach = (curve.span.0 - curve.origin)
        .abs()
        .max((curve.span.1 - curve.origin).abs());
    let factor = match curve.form {
        CurveForm::Polynomial => {
            let power = curve.power.get(place).copied().unwrap_or(0);
            reach.powi(i32::from(power))
        }
        _ => 1.0,
    };
    let estimable = curve.estimable.get(place).copied().unwrap_or(false);
    let shown = |value: Option<&f64>| match value {
        Some(value) if estimable && value.is_finite() => {
            format!(
                "{:.2} {}",
                value * factor * scale(curve.component),
                unit(curve.component)
            )
        }
        _ => "—".to_owned(),
    };
    vec![
        name(curve, place),
        shown(curve.coefficient.get(place)),
        shown(curve.standard_uncertainty.get(place)),
        if estimable { "yes" } else { "no" }.to_owned(),
    ]
}

fn scale(component: ErrorComponent) -> f64 {
    if component.is_angular() { 1e6 } else { 1e3 }
}

fn unit(component: ErrorComponent) -> &'static str {
    if component.is_angular() {
        "µrad"
    } else {
        "µm"
    }
}

/// One part for the positioning tables.
#[must_use]
pub fn tables(tables: &[PositioningTable]) -> Option<Section> {
    if tables.is_empty() {
        return None;
    }
    let mut section = Section::new("Positioning tables: scale minus motor");
    for table in tables {
        let rows = table.position.iter().enumerate().map(|(place, position)| {
            let of = |values: &[f64]| um(values.get(place).copied().unwrap_or(f64::NAN));
            vec![
                format!("{position:.3}"),
                of(&table.deviation_up),
                of(&table.deviation_down),
            ]
        });
        section.tables.push(Rows {
            head: vec![
                format!("{} / mm", table.axis),
                "up / µm".to_owned(),
                "down / µm".to_owned(),
            ],
            rows: rows.collect(),
            note: format!("{} runs, weight {}.", table.n_runs, table.weight),
        });
    }
    Some(section)
}
