//! Geometric errors as they were identified: what is known, how well, and what is not known.

use metrology::sample::{
    CurveForm, ErrorCurve, EstimableCombination, GeometryModel, PositioningTable,
};
use metrology::{ErrorComponent, squareness};

use super::screen::Tile;
use super::section::{Rows, Section, head, rounded, um};

mod curves;

/// Coverage factor of what is printed.
pub const COVERAGE: f64 = 2.0;
/// Coefficients that can be listed in a sentence.
const FEW: usize = 16;
/// Lever of turns in sums without a linear axis, mm.
const LEVER_MM: f64 = 100.0;
/// Members that a person can read in one sum.
pub const MAX_READABLE_MEMBERS: usize = 4;

/// One coefficient with its place in the model.
pub struct Coefficient<'a> {
    /// Its component.
    pub curve: &'a ErrorCurve,
    /// Place in the curve.
    pub place: usize,
}

/// What a value and a mark are.
const AT_THE_END: &str = "A coefficient times the greatest recorded distance from its origin to its power: µm for shifts, µrad for turns; ~: U exceeds it. ";
/// What U holds where all recordings of a bag were fitted.
const U_OF_ALL: &str = "U: expanded uncertainty as the residuals show it, those that follow each other counted as fewer, with what errors of the plate and heat between recordings leave open. How long and how square the plate is as a whole no recording can tell: that is in U where grid_encoder was given the plate's certificate (plate_scale_um_per_m, plate_squareness_urad).";
/// What U holds where one circle was fitted.
const U_OF_ONE_CIRCLE: &str = "U: expanded uncertainty as the residuals of this circle alone show it, those that follow each other counted as fewer. The plate's errors and its certificate, heat, and a lost motion that is no step are not in it.";

/// One part for a model of all recordings.
#[must_use]
pub fn section(title: &str, model: &GeometryModel) -> Section {
    described(title, model, U_OF_ALL)
}

/// One part for what one circle determines.
#[must_use]
pub fn section_of_one_circle(title: &str, model: &GeometryModel) -> Section {
    described(title, model, U_OF_ONE_CIRCLE)
}

fn described(title: &str, model: &GeometryModel, of_u: &str) -> Section {
    let all = coefficients(model);
    let known: Vec<&Coefficient> = all.iter().filter(|c| c.is_known()).collect();
    let mut section = Section::new(title);
    section.lines.push(format!(
        "Chain {}; {} unknowns, rank {}, {} readings; standard deviation of the residuals {} µm.",
        model.chain,
        model.n_unknowns,
        model.rank,
        model.n_samples,
        um(model.residual_standard_deviation_mm)
    ));
    section.answer(count(&all, &known));
    section
        .lines
        .extend(signs(model.curves.iter().map(|curve| curve.component)));
    section.tables.push(Rows {
        head: head(&[
            "coefficient",
            "at the end of the span",
            "± U (k = 2)",
            "span",
        ]),
        rows: known.iter().map(|coefficient| coefficient.row()).collect(),
        note: format!("{AT_THE_END}{of_u}"),
    });
    let (short, long): (Vec<_>, Vec<_>) = model
        .combinations
        .iter()
        .partition(|combination| combination.weights.len() <= MAX_READABLE_MEMBERS);
    if !model.combinations.is_empty() {
        section.tables.push(Rows {
            head: head(&["known only together", "± U (k = 2)", "at"]),
            rows: short
                .iter()
                .filter_map(|combination| sum(&all, combination))
                .map(|sum| sum.row())
                .collect(),
            note: together(long.len()),
        });
    }
    section.figures = figures(title, model, &all);
    section.tile = largest(&known).map(|(value, more)| {
        let more = format!("{more}; {}", count(&all, &known).trim_end_matches('.'));
        Tile::new("largest known geometric error", value, more)
    });
    match curves::drawings(model) {
        Ok(drawings) => section.drawings = drawings,
        Err(error) => section
            .lines
            .push(format!("The curves are not drawn: {error:#}.")),
    }
    section
}

/// The largest known shift, or turn where no shift is known, at the end of its span, with U; and what it is. None is smaller
/// than its U.
fn largest(known: &[&Coefficient]) -> Option<(String, String)> {
    let of = |is_angular: bool| {
        let own = { known.iter() }.filter(move |c| c.curve.component.is_angular() == is_angular);
        own.filter(|c| c.at_end().is_finite() && !c.is_below_u())
            .max_by(|a, b| a.at_end().abs().total_cmp(&b.at_end().abs()))
    };
    let largest = of(false).or_else(|| of(true))?;
    let (value, u) = largest.at_end_with_u();
    let component = largest.curve.component;
    Some((
        format!("{component} {value} ± {u} {}", unit(component)),
        format!("{}{}; k = 2", largest.in_words(), largest.lacks()),
    ))
}

/// A part of a polynomial by its power.
fn of_degree(power: u8) -> String {
    match power {
        0 => "constant part".to_owned(),
        1 => "linear part".to_owned(),
        2 => "quadratic part".to_owned(),
        3 => "cubic part".to_owned(),
        n => format!("part of degree {n}"),
    }
}

/// A sentence for the sign of each squareness among components; none without one.
#[must_use]
pub fn signs(components: impl Iterator<Item = ErrorComponent>) -> Option<String> {
    let mut components: Vec<ErrorComponent> = components.collect();
    components.sort();
    components.dedup();
    let words = components.into_iter().filter_map(squareness::in_words);
    let words: Vec<String> = words.collect();
    (!words.is_empty()).then(|| words.join(" "))
}

fn count(all: &[Coefficient], known: &[&Coefficient]) -> String {
    let n_known = known.len();
    let below = match known.iter().filter(|c| c.is_below_u()).count() {
        0 => String::new(),
        n => format!(" ({n} with a U above the value, marked ~)"),
    };
    let unknown: Vec<String> = all
        .iter()
        .filter(|c| !c.is_known())
        .map(Coefficient::name)
        .collect();
    if unknown.is_empty() {
        return format!("All {n_known} coefficients are known by themselves{below}.");
    }
    let names = if unknown.len() <= FEW {
        format!(": {}", unknown.join(", "))
    } else {
        String::new()
    };
    format!(
        "{n_known} of {} coefficients are known by themselves{below}; {} are not{names}.",
        all.len(),
        unknown.len()
    )
}

fn together(n_long: usize) -> String {
    let more = match n_long {
        0 => String::new(),
        1 => format!(" One sum of more than {MAX_READABLE_MEMBERS} members is in report.json."),
        n => format!(
            " {n} sums of more than {MAX_READABLE_MEMBERS} members each are in report.json."
        ),
    };
    format!(
        "What the recordings determine although its members are not known: each name stands for that error's value at the stated distance from its origin, a turn for its lever of the same length.{more}"
    )
}

/// A sum of errors at one distance.
pub struct Sum {
    /// (factor, name); the first factor is 1.
    pub members: Vec<(f64, String)>,
    /// Its value, mm.
    pub value_mm: f64,
    /// Of the value, mm.
    pub standard_uncertainty_mm: f64,
    /// Distance from the origin at which each member is meant, mm.
    pub at_mm: f64,
}

/// The sums that a model determines.
#[must_use]
pub fn sums(model: &GeometryModel) -> Vec<Sum> {
    let all = coefficients(model);
    let sums = model.combinations.iter();
    sums.filter_map(|combination| sum(&all, combination))
        .collect()
}

/// A combination with every member as its error at one distance, so that factors are plain numbers.
fn sum(all: &[Coefficient], combination: &EstimableCombination) -> Option<Sum> {
    let member = |(idx, weight): &(u32, f64)| Some((all.get(*idx as usize)?, *weight));
    let members: Vec<(&Coefficient, f64)> = combination
        .weights
        .iter()
        .map(member)
        .collect::<Option<_>>()?;
    let linear = members
        .iter()
        .filter(|(c, _)| c.curve.component.of.is_linear());
    let reaches = linear.map(|(c, _)| c.reach()).filter(|reach| *reach > 0.0);
    let at_mm = reaches.reduce(f64::max).unwrap_or(LEVER_MM);
    let factor = |(coefficient, weight): &(&Coefficient, f64)| weight / coefficient.lever(at_mm);
    let first = factor(members.first()?);
    Some(Sum {
        members: members
            .iter()
            .map(|member| (factor(member) / first, member.0.name()))
            .collect(),
        value_mm: combination.value_mm / first,
        standard_uncertainty_mm: combination.standard_uncertainty_mm / first.abs(),
        at_mm,
    })
}

impl Sum {
    /// Such as `EXY2 + 0.98 ECY1`.
    #[must_use]
    pub fn in_words(&self) -> String {
        let mut words = String::new();
        for (factor, name) in &self.members {
            let sign = match (words.is_empty(), *factor < 0.0) {
                (true, _) => "",
                (false, true) => " − ",
                (false, false) => " + ",
            };
            let size = format!("{:.2}", factor.abs());
            let size = if size == "1.00" {
                String::new()
            } else {
                size + " "
            };
            words.push_str(&format!("{sign}{size}{name}"));
        }
        words
    }

    fn row(&self) -> Vec<String> {
        let expanded = COVERAGE * self.standard_uncertainty_mm;
        let (value, u) = rounded(self.value_mm * 1e3, expanded * 1e3);
        vec![
            format!("{} = {value} µm", self.in_words()),
            format!("{u} µm"),
            format!("{:.0} mm", self.at_mm),
        ]
    }
}

fn figures(title: &str, model: &GeometryModel, all: &[Coefficient]) -> serde_json::Value {
    let coefficient = |c: &Coefficient| {
        let known = c.is_known();
        serde_json::json!({
            "name": c.name(),
            "estimable": known,
            "value": known.then(|| c.curve.coefficient.get(c.place)),
            "standard_uncertainty": known.then(|| c.curve.standard_uncertainty.get(c.place)),
            "reach": c.reach(),
        })
    };
    let combination = |sum: Sum| {
        serde_json::json!({
            "sum": sum.in_words(),
            "members": sum.members,
            "value_mm": sum.value_mm,
            "standard_uncertainty_mm": sum.standard_uncertainty_mm,
            "at_mm": sum.at_mm,
        })
    };
    let sums = sums(model).into_iter();
    serde_json::json!({
        "test": title,
        "geometry": {
            "chain": model.chain,
            "unknowns": model.n_unknowns,
            "rank": model.rank,
            "readings": model.n_samples,
            "residual_standard_deviation_mm": model.residual_standard_deviation_mm,
            "coefficients": all.iter().map(coefficient).collect::<Vec<_>>(),
            "combinations": sums.map(combination).collect::<Vec<_>>(),
        },
    })
}

/// Every coefficient of a model, in the order in which its combinations count them.
#[must_use]
pub fn coefficients(model: &GeometryModel) -> Vec<Coefficient<'_>> {
    let of = |curve| places(curve).map(move |place| Coefficient { curve, place });
    model.curves.iter().flat_map(of).collect()
}

fn places(curve: &ErrorCurve) -> std::ops::Range<usize> {
    0..curve.coefficient.len()
}

impl Coefficient<'_> {
    fn name(&self) -> String {
        let component = self.curve.component;
        match self.curve.form {
            CurveForm::Constant => component.to_string(),
            CurveForm::Polynomial => format!("{component}{}", self.power()),
            CurveForm::Table => {
                let at = self.curve.position.get(self.place);
                format!("{component} at {:.1}", at.copied().unwrap_or(f64::NAN))
            }
        }
    }

    /// Whether the recordings determine it by itself.
    #[must_use]
    pub fn is_known(&self) -> bool {
        let value = self.curve.coefficient.get(self.place);
        let said = self.curve.estimable.get(self.place).copied();
        said.unwrap_or(false) && value.is_some_and(|value| value.is_finite())
    }

    /// Name, expanded uncertainty at the end of the span and span, before there is a value.
    #[must_use]
    pub fn planned_row(&self) -> Vec<String> {
        let component = self.curve.component;
        let factor = self.reach().powi(i32::from(self.power())) * scale(component);
        let u = self.curve.standard_uncertainty.get(self.place);
        let (_, u) = rounded(0.0, COVERAGE * factor * u.copied().unwrap_or(f64::NAN));
        vec![self.name(), format!("{u} {}", unit(component)), self.span()]
    }

    /// Whether its value is smaller than its U.
    fn is_below_u(&self) -> bool {
        let u = COVERAGE * self.times_reach(&self.curve.standard_uncertainty);
        u > self.at_end().abs()
    }

    fn span(&self) -> String {
        let (least, greatest) = self.curve.span;
        let axis = self.curve.component.of;
        match self.curve.form {
            CurveForm::Constant => "—".to_owned(),
            _ if axis.is_linear() => format!("{axis} {least:.0} to {greatest:.0} mm"),
            _ => format!(
                "{axis} {:.0} to {:.0}°",
                least.to_degrees(),
                greatest.to_degrees()
            ),
        }
    }

    /// Power of the position; 0 for constants and knots.
    #[must_use]
    pub fn power(&self) -> u8 {
        match self.curve.form {
            CurveForm::Polynomial => self.curve.power.get(self.place).copied().unwrap_or(0),
            _ => 0,
        }
    }

    /// Greatest recorded distance from the origin, in the unit of the axis; 0 where nothing was recorded.
    fn reach(&self) -> f64 {
        let (least, greatest) = self.curve.span;
        let origin = self.curve.origin;
        (least - origin).abs().max((greatest - origin).abs())
    }

    /// Unit of its own to mm at a distance: the distance to its power, and once more for a turn.
    fn lever(&self, at_mm: f64) -> f64 {
        let component = self.curve.component;
        let arm = if component.is_angular() { at_mm } else { 1.0 };
        let way = if component.of.is_linear() {
            at_mm
        } else {
            self.reach()
        };
        arm * way.powi(i32::from(self.power()))
    }

    /// Value at the end of the span, µm or µrad.
    fn at_end(&self) -> f64 {
        self.times_reach(&self.curve.coefficient)
    }

    fn times_reach(&self, values: &[f64]) -> f64 {
        let factor = self.reach().powi(i32::from(self.power())) * scale(self.curve.component);
        values.get(self.place).copied().unwrap_or(f64::NAN) * factor
    }

    /// That it is no size of its error, where other parts of that are not known.
    fn lacks(&self) -> &'static str {
        let places = places(self.curve);
        let mut others = places.map(|place| Coefficient { place, ..*self });
        if others.all(|other| other.is_known()) {
            return "";
        }
        " (no size of the whole error: its other parts are not known)"
    }

    /// What it is, and where: `cubic part (coefficient ECY3) of the rotation of Y about Z, at the end of Y 0 to 300 mm`.
    fn in_words(&self) -> String {
        let component = self.curve.component;
        let (what, axis) = (component.in_words(), component.of);
        match self.curve.form {
            CurveForm::Constant => what,
            CurveForm::Polynomial => format!(
                "{} (coefficient {}) of the {what}, at the end of {}",
                of_degree(self.power()),
                self.name(),
                self.span()
            ),
            CurveForm::Table => {
                let at = self.curve.position.get(self.place);
                let at = at.copied().unwrap_or(f64::NAN);
                let at = if axis.is_linear() {
                    format!("{at:.1} mm")
                } else {
                    format!("{:.1}°", at.to_degrees())
                };
                format!("{what}, at {axis} = {at}")
            }
        }
    }

    /// Value at the end of the span and its U, µm or µrad.
    fn at_end_with_u(&self) -> (String, String) {
        let u = COVERAGE * self.times_reach(&self.curve.standard_uncertainty);
        rounded(self.at_end(), u)
    }

    fn row(&self) -> Vec<String> {
        let component = self.curve.component;
        let (value, u) = self.at_end_with_u();
        let mark = if self.is_below_u() { " ~" } else { "" };
        vec![
            self.name(),
            format!("{value} {}{mark}", unit(component)),
            u,
            self.span(),
        ]
    }
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
        let all = || table.deviation_up.iter().chain(&table.deviation_down);
        let size_mm = all().fold(0.0, |most: f64, mm| {
            if mm.is_finite() {
                most.max(mm.abs())
            } else {
                most
            }
        });
        let pairs = table.deviation_up.iter().zip(&table.deviation_down);
        let apart: Vec<f64> = pairs
            .map(|(up, down)| up - down)
            .filter(|mm| mm.is_finite())
            .collect();
        let reversal_mm = apart.iter().sum::<f64>() / apart.len() as f64;
        section.answer(format!(
            "{}: scale and motor are up to {} µm apart; up minus down {} µm on the mean of {} places.",
            table.axis,
            um(size_mm),
            um(reversal_mm),
            apart.len()
        ));
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

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(name: &str, form: CurveForm) -> ErrorCurve {
        ErrorCurve {
            component: name.parse().unwrap(),
            form,
            origin: 0.0,
            power: vec![3],
            position: vec![-126.0],
            coefficient: vec![1e-12],
            standard_uncertainty: vec![1e-14],
            estimable: vec![true],
            span: (0.0, 300.0),
        }
    }

    #[test]
    fn the_largest_coefficient_is_named_by_its_part_its_error_and_its_place() {
        for (name, form, wanted) in [
            (
                "ECY",
                CurveForm::Polynomial,
                "cubic part (coefficient ECY3) of the rotation of Y about Z, at the end of Y 0 to 300 mm; k = 2",
            ),
            ("EC0Y", CurveForm::Constant, "squareness of Y to X; k = 2"),
            (
                "EXY",
                CurveForm::Table,
                "straightness of Y along X, at Y = -126.0 mm; k = 2",
            ),
        ] {
            let curve = curve(name, form);
            let known = Coefficient {
                curve: &curve,
                place: 0,
            };
            assert_eq!(largest(&[&known]).unwrap().1, wanted);
        }
        let curve = curve("ECY", CurveForm::Polynomial);
        let known = Coefficient {
            curve: &curve,
            place: 0,
        };
        let mut parts = curve.clone();
        parts.power = vec![3, 1];
        parts.coefficient = vec![1e-12, f64::NAN];
        parts.standard_uncertainty = vec![1e-14, f64::NAN];
        parts.estimable = vec![true, false];
        let alone = Coefficient {
            curve: &parts,
            place: 0,
        };
        let words = largest(&[&alone]).unwrap().1;
        assert!(words.contains("its other parts are not known"), "{words}");
        // By hand: 1e-12 rad/mm^3 * (300 mm)^3 = 27 µrad, twice 0.27 µrad.
        assert_eq!(largest(&[&known]).unwrap().0, "ECY 27.00 ± 0.54 µrad");
    }
}
