//! What else of the catalogue makes the readings of an effect in a shift.
//!
//! Each name has variants: lags, instants, pairs of time constants. A name makes the same readings where one of its variants,
//! with sizes that are free, leaves less of them than noise shows (D below 3). Forms are written anew from their
//! descriptions: lags, steps between two block cycles, lines along an axis, and powers of time.

use super::super::ballbar::LETTERS;
use super::super::heat::{KEPT_S, Node, lagged};
use super::super::machine_motion::Motion;
use super::super::truth::{Name, name};
use super::hidden::Effect;
use super::size::{Sizing, Weighed};
use super::timetable::{Block, Timetable, Touched};
use super::warmth::{Warmth, at};

/// Below this D apart from an alternative both make the same readings.
const MAX_D_OF_SAME: f64 = 3.0;
/// What the catalogue's form of an effect may leave of it, as a share of D: more is another form.
const MAX_SHARE_LEFT: f64 = 0.35;
/// Lags of what follows a thermometer, min.
const LAGS_MIN: [f64; 6] = [0.0, 5.0, 15.0, 40.0, 90.0, 180.0];
/// Fast and slow time constants of a spindle, min.
const PAIRS_MIN: [[f64; 2]; 4] = [[1.0, 15.0], [5.0, 40.0], [5.0, 100.0], [12.0, 200.0]];
/// Lags of a screw, min.
const SCREWS_MIN: [f64; 4] = [2.0, 10.0, 30.0, 90.0];
/// Lags of what begins at an instant, min.
const BEGUN_MIN: [f64; 2] = [2.0, 10.0];
/// Temperature at which lengths are what they should be, °C.
const REFERENCE_DEGC: f64 = 20.0;

/// A name with its variants, each some columns.
pub struct Imitator {
    name: Name,
    variants: Vec<Vec<Weighed>>,
}

impl Imitator {
    /// D of what its best variant leaves of `own`, others being taken out.
    fn left(&self, sizing: &Sizing, own: &Weighed, others: &[&Weighed]) -> f64 {
        let left = self.variants.iter().map(|variant| {
            let mut taken_out = others.to_vec();
            taken_out.extend(variant);
            sizing.d(own, &taken_out)
        });
        left.fold(f64::MAX, f64::min)
    }

    /// Whether it makes the same readings as `own`, others being taken out.
    pub fn is_same(&self, sizing: &Sizing, own: &Weighed, others: &[&Weighed]) -> bool {
        self.left(sizing, own, others) < MAX_D_OF_SAME
    }

    /// Whether its form is near enough to that of `own` to be its name.
    pub fn describes(&self, sizing: &Sizing, own: &Weighed) -> bool {
        let whole = sizing.d(own, &[]);
        self.left(sizing, own, &[]) < MAX_D_OF_SAME.max(MAX_SHARE_LEFT * whole)
    }

    /// Its name.
    pub const fn name(&self) -> &Name {
        &self.name
    }
}

/// Makes the columns of a shift.
struct Columns<'s> {
    table: &'s Timetable,
    warmth: &'s Warmth,
    sizing: &'s Sizing,
    found: Vec<Imitator>,
}

/// Everything in the catalogue that moves touches during a shift.
pub fn imitators(table: &Timetable, warmth: &Warmth, sizing: &Sizing) -> Vec<Imitator> {
    let mut columns = Columns {
        table,
        warmth,
        sizing,
        found: vec![],
    };
    columns.thermometers();
    columns.spindle();
    columns.column();
    columns.workpiece();
    for axis in 0..3 {
        columns.drift(axis);
        columns.screw(axis);
    }
    columns.steps();
    columns.found
}

impl Columns<'_> {
    /// A column that touches alone have.
    fn touched(&self, of: impl Fn(&Touched, &Block) -> f64) -> Vec<f64> {
        let rows = self.table.turns().map(|turn| turn.circle.angles.len());
        let mut column = vec![0.0; rows.sum()];
        let touches = self.table.touches();
        column.extend(touches.map(|touch| of(touch, &self.table.blocks[touch.block])));
        column
    }

    /// The same of one axis, by a series that is kept.
    fn along(&self, axis: usize, kept: &[f64], arm: impl Fn(&Block) -> f64) -> Vec<f64> {
        self.touched(|touch, block| {
            let is_own = f64::from(u8::from(touch.axis == axis));
            is_own * at(kept, touch.at_s) * arm(block)
        })
    }

    fn add(&mut self, name: Name, variants: Vec<Vec<Vec<f64>>>) {
        let weigh = |columns: Vec<Vec<f64>>| {
            let weighed = columns.iter().map(|column| self.sizing.weigh(column));
            weighed.collect()
        };
        let variants = variants.into_iter().map(weigh).collect();
        self.found.push(Imitator { name, variants });
    }

    fn reading(&self, node: Node) -> Option<&[f64]> {
        let own = self.warmth.thermometers.iter().find(|it| it.node == node);
        own.map(|it| it.degc.as_slice())
    }

    fn thermometers(&mut self) {
        for thermometer in self.warmth.thermometers.clone() {
            let variant = |lag_min: f64| {
                let kept = lagged(&thermometer.degc, 60.0 * lag_min);
                let shift = |axis| self.along(axis, &kept, |_| 1.0);
                (0..3).map(shift).collect::<Vec<Vec<f64>>>()
            };
            let variants = LAGS_MIN.into_iter().map(variant).collect();
            self.add(name("thermal_shift", thermometer.id), variants);
        }
    }

    /// Growth along Z, and the sideways shift of the wider form.
    fn spindle(&mut self) {
        let evenly: Vec<f64> = vec![1.0; (self.table.end_s() / KEPT_S) as usize + 2];
        let from_cold: Vec<f64> = std::iter::once(0.0).chain(evenly).collect();
        let warms = self.reading(Node::Front).map_or(from_cold, <[f64]>::to_vec);
        let variant = |[fast_min, slow_min]: [f64; 2]| {
            let [fast, slow] = [fast_min, slow_min].map(|min| lagged(&warms, 60.0 * min));
            let mut columns = vec![self.along(2, &fast, |_| 1.0)];
            columns.extend((0..3).map(|axis| self.along(axis, &slow, |_| 1.0)));
            columns
        };
        let variants = PAIRS_MIN.into_iter().map(variant).collect();
        self.add(name("spindle_growth", ""), variants);
    }

    /// Shift along Y and Z and a tilt, by the column less the air.
    fn column(&mut self) {
        let warms = |node| self.reading(node).map(<[f64]>::to_vec);
        let driven = match (warms(Node::Column), warms(Node::Room)) {
            (Some(column), Some(room)) => {
                let apart = column.iter().zip(&room).map(|(a, b)| a - b);
                Some(apart.collect::<Vec<f64>>())
            }
            (Some(own), None) | (None, Some(own)) => Some(own),
            (None, None) => warms(Node::Bed),
        };
        let Some(driven) = driven else {
            return;
        };
        let variant = |lag_min: f64| {
            let kept = lagged(&driven, 60.0 * lag_min);
            let mut columns: Vec<Vec<f64>> = (0..3)
                .map(|axis| self.along(axis, &kept, |_| 1.0))
                .collect();
            let by_y = self.along(1, &kept, |block| -block.corner_mm[2]);
            let by_z = self.along(2, &kept, |block| block.corner_mm[1]);
            columns.push(by_y.iter().zip(&by_z).map(|(y, z)| y + z).collect());
            columns
        };
        let variants = LAGS_MIN.into_iter().map(variant).collect();
        self.add(name("column_bend", ""), variants);
    }

    fn workpiece(&mut self) {
        let Some(air) = self.reading(Node::Room) else {
            return;
        };
        let above: Vec<f64> = air.iter().map(|degc| degc - REFERENCE_DEGC).collect();
        let variant = |lag_min: f64| {
            let kept = lagged(&above, 60.0 * lag_min);
            let grows = |axis: usize| self.along(axis, &kept, |block| block.corner_mm[axis]);
            (0..3).map(grows).collect()
        };
        let variants = LAGS_MIN.into_iter().map(variant).collect();
        self.add(name("workpiece_expansion", ""), variants);
    }

    /// Powers of time, and the air where it is read.
    fn drift(&mut self, axis: usize) {
        let end_s = self.table.end_s();
        let power = |power: i32| {
            self.touched(|touch, _| {
                let is_own = f64::from(u8::from(touch.axis == axis));
                is_own * (touch.at_s / end_s).powi(power)
            })
        };
        let mut columns: Vec<Vec<f64>> = (1..=3).map(power).collect();
        let air = self.reading(Node::Room);
        columns.extend(air.map(|air| self.along(axis, air, |_| 1.0)));
        self.add(name("ambient_drift", LETTERS[axis]), vec![columns]);
    }

    /// Strain by the axis' own motion, from any fixed bearing; circles become oval.
    fn screw(&mut self, axis: usize) {
        let load = self.warmth.axis_load.iter().step_by(KEPT_S as usize);
        let load: Vec<f64> = std::iter::once(0.0).chain(load.copied()).collect();
        let variant = |lag_min: f64| {
            let strain = lagged(&load, 60.0 * lag_min);
            let mut oval = self.along(axis, &strain, |block| 1e-3 * block.corner_mm[axis]);
            let mut from = 0;
            for turn in self.table.turns() {
                let grown = at(&strain, 0.5 * (turn.span_s[0] + turn.span_s[1]));
                let scale = Motion::Scale(axis).radial_um(&turn.circle);
                for (value, one) in oval[from..].iter_mut().zip(scale) {
                    *value = grown * one;
                }
                from += turn.circle.angles.len();
            }
            vec![oval, self.along(axis, &strain, |_| 1.0)]
        };
        let variants = SCREWS_MIN.into_iter().map(variant).collect();
        self.add(name("screw_elongation", LETTERS[axis]), variants);
    }

    /// What begins between two block cycles: references, coolant, the stylus.
    fn steps(&mut self) {
        // Coolant flows as soon as a cycle is over, so that it has come to its end at the next one.
        let begins: Vec<f64> = { self.table.cycles() }
            .map(|cycle| cycle.span_s[1] + 1.0)
            .collect();
        let step = |from_s: &f64, axis: usize| {
            let from_s = *from_s;
            self.touched(|touch, _| f64::from(u8::from(touch.axis == axis && touch.at_s > from_s)))
        };
        let begun = |from_s: &f64, axis: usize, lag_min: f64, has_arm: bool| {
            let from_s = *from_s;
            self.touched(|touch, block| {
                let since_s = (touch.at_s - from_s).max(0.0);
                let arm = if has_arm { block.corner_mm[axis] } else { 1.0 };
                let is_own = f64::from(u8::from(touch.axis == axis));
                is_own * arm * (1.0 - (-since_s / (60.0 * lag_min)).exp())
            })
        };
        let mut all: Vec<(Name, Vec<Vec<Vec<f64>>>)> = vec![];
        for (axis, letter) in LETTERS.into_iter().enumerate() {
            let shifts = begins.iter().map(|from_s| vec![step(from_s, axis)]);
            all.push((name("homing_shift", letter), shifts.collect()));
            let flows = begins.iter().flat_map(|from_s| {
                BEGUN_MIN.map(|lag_min| [false, true].map(|arm| begun(from_s, axis, lag_min, arm)))
            });
            let flows = flows.map(|columns| columns.to_vec()).collect();
            all.push((name("coolant", letter), flows));
        }
        let bumped = begins.iter().map(|from_s| {
            let smaller = self.touched(|touch, block| {
                f64::from(u8::from(touch.at_s > *from_s)) * block.senses[touch.axis]
            });
            let mut columns = vec![smaller];
            columns.extend((0..3).map(|axis| step(from_s, axis)));
            columns
        });
        all.push((name("stylus_jump", ""), bumped.collect()));
        for (name, variants) in all {
            self.add(name, variants);
        }
    }
}

/// Whether other effects that move touches may make the readings of one.
pub const fn has_imitators(effect: &Effect) -> bool {
    use super::hidden::Kind::{Creep, Drive, Slip};
    !matches!(effect.kind, Drive(_) | Slip(..) | Creep(..))
}
