//! Geometry models that come in: of this machine, of others, and of none.

use axis_compensation::geometric::GeometrySource;
use machine::volumetric::components_of;
use metrology::sample::{CurveForm, ErrorCurve, GeometryModel};
use metrology::{ErrorComponent, Host, Stamp};
use nalgebra::DMatrix;
use proptest::prelude::*;
use proptest::sample::{Index, subsequence};

pub const CHAIN: &str = "[w C' A' Y' b X Z t]";
const SHIFT_MM: f64 = 0.12;
const TURN_RAD: f64 = 3e-4;
/// Curves of one model at most; each takes part of the size limit of 0.3 mm.
const MOST_CURVES: usize = 5;

#[derive(Clone, Debug)]
pub struct Geometry {
    pub source: GeometrySource,
    pub number: Number,
    pub content: Content,
}

/// The sequence of a model beside the last one of its kind.
#[derive(Clone, Copy, Debug)]
pub enum Number {
    Next,
    Same,
    Back(u32),
    Any(u32),
}

#[derive(Clone, Debug)]
pub enum Content {
    /// The curves of the last one of its kind, each value times this.
    Again(f64),
    New(Vec<ErrorCurve>, Fault),
}

/// What is wrong with a model.
#[derive(Clone, Debug)]
pub enum Fault {
    None,
    /// Every value is so many times what machines have.
    Scaled(f64),
    Number(Place, Index, f64),
    Chain(&'static str),
    Component(&'static str),
    Twice,
    CoefficientMissing,
    /// The axis stood while it was recorded.
    Stood,
    /// It comes as a model of the other kind.
    OtherSource,
}

#[derive(Clone, Copy, Debug)]
pub enum Place {
    Coefficient,
    Knot,
    Origin,
    Lower,
    Upper,
}

impl Number {
    pub fn after(self, last: u32) -> u32 {
        match self {
            Self::Next => last.wrapping_add(1),
            Self::Same => last,
            Self::Back(by) => last.wrapping_sub(by),
            Self::Any(number) => number,
        }
    }
}

/// A model without faults; of its other fields the stage reads none.
pub fn model(at: Stamp<Host>, sequence: u32, curves: Vec<ErrorCurve>) -> GeometryModel {
    GeometryModel {
        at,
        chain: CHAIN.to_owned(),
        curves,
        covariance: DMatrix::zeros(0, 0),
        combinations: Vec::new(),
        n_samples: 100,
        n_unknowns: 1,
        rank: 1,
        residual_standard_deviation_mm: f64::NAN,
        sequence,
    }
}

impl Fault {
    /// Does to a model what it says; `source` is where the model comes from.
    pub fn mar(&self, model: &mut GeometryModel, source: &mut GeometrySource) {
        let curves = &mut model.curves;
        match self {
            Self::None => {}
            Self::Scaled(by) => scale(curves, *by),
            Self::Number(place, index, value) => {
                if let Some(curve) = curves.first_mut() {
                    place.set(curve, *index, *value);
                }
            }
            Self::Chain(chain) => (*chain).clone_into(&mut model.chain),
            Self::Component(name) => {
                if let Some(curve) = curves.first_mut() {
                    curve.component = name.parse().unwrap();
                }
            }
            Self::Twice => curves.extend(curves.first().cloned()),
            Self::CoefficientMissing => {
                if let Some(curve) = curves.first_mut() {
                    curve.coefficient.pop();
                }
            }
            Self::Stood => {
                if let Some(curve) = curves.first_mut() {
                    curve.span.1 = curve.span.0;
                }
            }
            Self::OtherSource => *source = other(*source),
        }
    }
}

impl Place {
    fn set(self, curve: &mut ErrorCurve, index: Index, value: f64) {
        let list = match self {
            Self::Coefficient => &mut curve.coefficient,
            Self::Knot => &mut curve.position,
            Self::Origin => return curve.origin = value,
            Self::Lower => return curve.span.0 = value,
            Self::Upper => return curve.span.1 = value,
        };
        // A form without knots is spoilt in its coefficients.
        let list = if list.is_empty() {
            &mut curve.coefficient
        } else {
            list
        };
        let place = index.index(list.len());
        list[place] = value;
    }
}

pub fn scale(curves: &mut [ErrorCurve], by: f64) {
    let values = curves.iter_mut().flat_map(|curve| &mut curve.coefficient);
    values.for_each(|value| *value *= by);
}

fn other(source: GeometrySource) -> GeometrySource {
    match source {
        GeometrySource::Linear => GeometrySource::Rotary,
        GeometrySource::Rotary => GeometrySource::Linear,
    }
}

/// Everything but the component: form, span, and what share of the greatest error each coefficient makes.
#[derive(Clone, Debug)]
struct Shape {
    form: CurveForm,
    half_span: f64,
    powers: Vec<u8>,
    knots: Vec<f64>,
    shares: Vec<f64>,
}

fn shape() -> impl Strategy<Value = Shape> {
    let form = prop_oneof![
        1 => Just(CurveForm::Constant),
        2 => Just(CurveForm::Polynomial),
        1 => Just(CurveForm::Table),
    ];
    let powers = subsequence(vec![0, 1, 2, 3, 4, 5], 1..=4);
    let gaps = prop_oneof![Just(vec![1.0; 6]), prop::collection::vec(0.05..1.0_f64, 6)];
    let shares = prop::collection::vec(-1.0..1.0_f64, 6);
    (form, 0.3..1.3_f64, powers, gaps, shares).prop_map(
        |(form, half_span, powers, gaps, shares)| {
            let length: f64 = gaps.iter().sum();
            let ends = gaps.iter().scan(0.0, |end, gap| {
                *end += gap;
                Some(*end)
            });
            let knots = ends.map(|end| 2.0 * end / length - 1.0).collect();
            Shape {
                form,
                half_span,
                powers,
                knots,
                shares,
            }
        },
    )
}

impl Shape {
    fn curve(&self, component: ErrorComponent) -> ErrorCurve {
        let reach = if component.of.is_linear() { 250.0 } else { 3.0 };
        let half_span = self.half_span * reach;
        let greatest = if component.is_angular() {
            TURN_RAD
        } else {
            SHIFT_MM
        };
        let form = if component.is_location {
            CurveForm::Constant
        } else {
            self.form
        };
        let (power, position): (Vec<u8>, Vec<f64>) = match form {
            CurveForm::Constant => (Vec::new(), Vec::new()),
            CurveForm::Polynomial => (self.powers.clone(), Vec::new()),
            CurveForm::Table => (
                Vec::new(),
                self.knots.iter().map(|knot| knot * half_span).collect(),
            ),
        };
        let count = (power.len() + position.len()).max(1);
        let scale = |place: usize| {
            power
                .get(place)
                .map_or(1.0, |&power| half_span.powi(power.into()))
        };
        let values = self.shares.iter().take(count).enumerate();
        ErrorCurve {
            component,
            form,
            origin: 0.0,
            coefficient: values
                .map(|(place, share)| share * greatest / scale(place))
                .collect(),
            power,
            position,
            standard_uncertainty: vec![f64::NAN; count],
            estimable: vec![true; count],
            span: (-half_span, half_span),
        }
    }
}

fn curves(source: GeometrySource) -> impl Strategy<Value = Vec<ErrorCurve>> {
    let is_linear = source == GeometrySource::Linear;
    let mut components = components_of(&CHAIN.parse().unwrap());
    components.retain(|component| component.of.is_linear() == is_linear);
    let some = subsequence(components, 0..=MOST_CURVES).prop_shuffle();
    (some, prop::collection::vec(shape(), MOST_CURVES)).prop_map(|(components, shapes)| {
        let both = components.into_iter().zip(shapes);
        both.map(|(component, shape)| shape.curve(component))
            .collect()
    })
}

fn fault() -> impl Strategy<Value = Fault> {
    let place = prop_oneof![
        4 => Just(Place::Coefficient),
        2 => Just(Place::Knot),
        1 => Just(Place::Origin),
        1 => Just(Place::Lower),
        1 => Just(Place::Upper),
    ];
    let value = prop::sample::select(vec![
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        1e200,
        -1e308,
        1e12,
    ]);
    let chains = [
        "[w X' Y' b Z t]",
        "[w A' C' Y' b X Z t]",
        "[w b X Y Z C A t]",
        "]C[",
        "",
    ];
    let components = ["EXB", "EX0B", "EZ0C", "EC0X", "EX0A"];
    prop_oneof![
        12 => Just(Fault::None),
        3 => (3.0..200.0_f64).prop_map(Fault::Scaled),
        4 => (place, any::<Index>(), value).prop_map(|(place, index, value)| Fault::Number(place, index, value)),
        1 => prop::sample::select(chains.to_vec()).prop_map(Fault::Chain),
        1 => prop::sample::select(components.to_vec()).prop_map(Fault::Component),
        1 => Just(Fault::Twice),
        1 => Just(Fault::CoefficientMissing),
        1 => Just(Fault::Stood),
        1 => Just(Fault::OtherSource),
    ]
}

/// A message of either kind.
pub fn geometry() -> impl Strategy<Value = Geometry> {
    let number = prop_oneof![
        8 => Just(Number::Next),
        2 => Just(Number::Same),
        2 => (1..5_u32).prop_map(Number::Back),
        1 => any::<u32>().prop_map(Number::Any),
    ];
    let again = prop_oneof![2 => Just(1.0), 2 => 0.95..1.05_f64, 1 => -2.0..2.0_f64];
    let of = |source| (Just(source), curves(source));
    let new = prop_oneof![of(GeometrySource::Linear), of(GeometrySource::Rotary)];
    (number, again, new, fault(), prop::bool::weighted(0.3)).prop_map(
        |(number, by, (source, curves), fault, is_again)| Geometry {
            source,
            number,
            content: if is_again {
                Content::Again(by)
            } else {
                Content::New(curves, fault)
            },
        },
    )
}
