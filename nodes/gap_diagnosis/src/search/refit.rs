//! Joint refit of all sizes and shapes of a set, through the simulator.
//!
//! # Model
//!
//! Gauss-Newton on the whitened residual, every step halved until it helps, every value within its physical
//! range; shapes are first refined between their neighbours on the grid by golden section:
//!
//! ```text
//!   v <- v + (J'J)^-1 J'(z - f(v)),   J by differences of the twin        (1)
//!   cov = (J'J)^-1 (sum_r J_r' e_r e_r' J_r) (J'J)^-1, clusters r = runs  (2)
//! ```
//!
//! The interval takes the greater of (2) and (J'J)^-1, for few clusters make (2) too small. In these intervals a shape whose
//! places on the grid have ends a and b, one step beyond its outer ones, has what physics knows of it,
//!
//! ```text
//!   J'J + 1/u_0^2,   u_0 = v min(ln(b / a) / sqrt 12, ln 2)               (3)
//! ```
//!
//! so that the size of a spike that is too quick for the readings is stated for the widths that machines have. Beyond a factor of
//! two an interval of a line about v means nothing.
//!
//! # References
//! \[1\] H. White, Econometrica 48, 1980; K.-Y. Liang, S. L. Zeger, Biometrika 73, 1986 (the sandwich).

use nalgebra::{DMatrix, DVector};
use twin::effects::{Parameter, Role};

use crate::noise::normal::Normal;
use crate::noise::stack::Stack;
use crate::search::lines;
use crate::search::rows::count;
use crate::search::signature::{Form, Instance, Library};

/// Values of one effect with their 95 % intervals.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// All values, parameters then free ones.
    pub values: Vec<f64>,
    /// Which of them were estimated.
    pub active: Vec<usize>,
    /// Lower ends.
    pub low: Vec<f64>,
    /// Upper ends.
    pub high: Vec<f64>,
    /// Whether a value stands at its physical bound.
    pub at_bound: Vec<bool>,
    /// The first value with those that are shares of it, and the ends of the interval of their sum; none without shares.
    pub whole: Option<[f64; 3]>,
    /// Norm of the whitened signature.
    pub d: f64,
}

/// A set with its values, whitened signatures and derivatives.
pub struct Refit {
    /// One a form.
    pub estimates: Vec<Estimate>,
    /// Whitened signature of each form at its values.
    pub parts: Vec<DVector<f64>>,
    /// Derivatives by all active values, in the order of forms.
    pub jacobian: Vec<DVector<f64>>,
}

impl Refit {
    /// What the set leaves of the stack.
    pub fn left(&self, stack: &Stack<'_>) -> DVector<f64> {
        self.parts
            .iter()
            .fold(stack.z.clone(), |left, part| left - part)
    }
}

struct Member<'f> {
    instance: &'f Instance,
    values: Vec<f64>,
    active: Vec<usize>,
}

fn parameter(instance: &Instance, place: usize) -> &'static Parameter {
    let free = place.checked_sub(instance.kind.parameters.len());
    free.map_or_else(
        || &instance.kind.parameters[place],
        |k| &instance.kind.free[k],
    )
}

impl Member<'_> {
    /// Values that are shares of the first one, where that is estimated as well.
    fn shares(&self) -> impl Iterator<Item = usize> {
        let has_first = self.active.first() == Some(&0);
        let active = self.active.iter().copied();
        active.filter(move |place| has_first && parameter(self.instance, *place).is_share)
    }

    fn signature(&self, stack: &Stack<'_>) -> DVector<f64> {
        stack.signature(&*self.instance.effect(&self.values))
    }

    fn moved(&self, place: usize, by: f64) -> Self {
        let mut values = self.values.clone();
        values[place] += by;
        Self {
            instance: self.instance,
            values,
            active: self.active.clone(),
        }
    }
}

/// Refits a set of forms whose sizes, in typical units, are known from the linear fit.
pub fn joint(stack: &Stack<'_>, signatures: &Library, forms: &[&Form], sizes: &[f64]) -> Refit {
    let mut sizes = sizes.iter();
    let mut members: Vec<Member<'_>> = forms
        .iter()
        .map(|form| start(&signatures.instances[form.instance], form, &mut sizes))
        .collect();
    let mut parts: Vec<DVector<f64>> = members.iter().map(|m| m.signature(stack)).collect();
    for index in 0..members.len() {
        refine_shapes(stack, &mut members, &mut parts, index);
    }
    for _ in 0..5 {
        if !step(stack, &mut members, &mut parts) {
            break;
        }
    }
    estimates(stack, &members, parts)
}

fn start<'f>(
    instance: &'f Instance,
    form: &Form,
    sizes: &mut std::slice::Iter<'_, f64>,
) -> Member<'f> {
    let mut values = form.values.clone();
    let mut active = form.amplitudes.clone();
    for (place, size) in form.amplitudes.iter().zip(sizes) {
        let parameter = parameter(instance, *place);
        values[*place] = (size * parameter.typical).clamp(parameter.low, parameter.high);
    }
    for (place, parameter) in instance.kind.parameters.iter().enumerate() {
        if parameter.role.grid().is_some_and(|grid| grid.len() > 1) {
            active.push(place);
        }
    }
    active.sort_unstable();
    Member {
        instance,
        values,
        active,
    }
}

/// Golden section of every shape of one member between its neighbours on the grid, its sizes solved anew.
fn refine_shapes(
    stack: &Stack<'_>,
    members: &mut [Member<'_>],
    parts: &mut [DVector<f64>],
    index: usize,
) {
    let mut rest = stack.z.clone();
    for (other, part) in parts.iter().enumerate() {
        if other != index {
            rest -= part;
        }
    }
    for place in members[index].active.clone() {
        let member = &members[index];
        let at = |value: f64| scaled(stack, member, place, value, &rest);
        let Some([low, high]) = near(stack, member, place) else {
            continue;
        };
        let [best, here] = [golden(low, high, at), at(member.values[place])];
        // Between two points of a grid a shape may have more than one least.
        let better = if best.1 < here.1 { best } else { here };
        members[index].values = better.0;
    }
    parts[index] = members[index].signature(stack);
}

/// Where a shape is refined: between its neighbours on the grid, or about its line.
fn near(stack: &Stack<'_>, member: &Member<'_>, place: usize) -> Option<[f64; 2]> {
    let at = member.values[place];
    let role = parameter(member.instance, place).role;
    if let Role::Frequency { .. } = role {
        let width = lines::width(stack.twin.machine(), &member.instance.target)?;
        return Some([at - 0.5 * width, at + 0.5 * width]);
    }
    let grid = role.grid()?;
    let near = grid
        .iter()
        .position(|g| *g >= at - 1e-12 * at.abs())
        .unwrap_or(grid.len() - 1);
    Some([
        grid[near.saturating_sub(1)],
        grid[(near + 1).min(grid.len() - 1)],
    ])
}

/// Values with one shape set and the sizes solved anew, and the square that is left.
fn scaled(
    stack: &Stack<'_>,
    member: &Member<'_>,
    place: usize,
    value: f64,
    rest: &DVector<f64>,
) -> (Vec<f64>, f64) {
    let is_size = |p: &usize| parameter(member.instance, *p).role == Role::Amplitude;
    let sizes: Vec<usize> = member.active.iter().copied().filter(is_size).collect();
    let columns: Vec<DVector<f64>> = sizes
        .iter()
        .map(|size| {
            let mut values = member.values.clone();
            for other in &sizes {
                values[*other] = 0.0;
            }
            values[place] = value;
            values[*size] = parameter(member.instance, *size).typical;
            stack.signature(&*member.instance.effect(&values))
        })
        .collect();
    let mut values = member.values.clone();
    values[place] = value;
    if columns.is_empty() {
        return (values, rest.norm_squared());
    }
    let normal = Normal::new(&DMatrix::from_columns(&columns), rest);
    let fit = normal.solve(&(0..columns.len()).collect::<Vec<_>>());
    for (size, amount) in sizes.iter().zip(&fit.sizes) {
        let of = parameter(member.instance, *size);
        values[*size] = (amount * of.typical).clamp(of.low, of.high);
    }
    (values, rest.norm_squared() - fit.gain)
}

/// What a function gives where its square is least between two points, in their logarithm where both are positive.
fn golden(low: f64, high: f64, at: impl Fn(f64) -> (Vec<f64>, f64)) -> (Vec<f64>, f64) {
    let log = low > 0.0;
    let (mut a, mut b) = if log {
        (low.ln(), high.ln())
    } else {
        (low, high)
    };
    let back = |x: f64| if log { x.exp() } else { x };
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut c, mut d) = (b - ratio * (b - a), a + ratio * (b - a));
    let (mut at_c, mut at_d) = (at(back(c)), at(back(d)));
    for _ in 0..10 {
        if at_c.1 < at_d.1 {
            (b, d, at_d) = (d, c, at_c);
            c = b - ratio * (b - a);
            at_c = at(back(c));
        } else {
            (a, c, at_c) = (c, d, at_d);
            d = a + ratio * (b - a);
            at_d = at(back(d));
        }
    }
    if at_c.1 < at_d.1 { at_c } else { at_d }
}

/// J of all active values, in the order of members.
fn jacobian(
    stack: &Stack<'_>,
    members: &[Member<'_>],
    parts: &[DVector<f64>],
) -> Vec<DVector<f64>> {
    let mut columns = Vec::new();
    for (member, part) in members.iter().zip(parts) {
        for &place in &member.active {
            let of = parameter(member.instance, place);
            let mut by = 1e-3 * member.values[place].abs().max(0.1 * of.typical.abs());
            if member.values[place] + by > of.high {
                by = -by;
            }
            columns.push((member.moved(place, by).signature(stack) - part) / by);
        }
    }
    columns
}

/// One step (1); false where nothing moved any more.
fn step(stack: &Stack<'_>, members: &mut [Member<'_>], parts: &mut [DVector<f64>]) -> bool {
    let mut left = stack.z.clone();
    for part in parts.iter() {
        left -= part;
    }
    let columns = jacobian(stack, members, parts);
    if columns.is_empty() {
        return false;
    }
    let normal = Normal::new(&DMatrix::from_columns(&columns), &left);
    let by = normal.solve(&(0..columns.len()).collect::<Vec<_>>()).sizes;
    let before = left.norm_squared();
    let mut share = 1.0;
    for _ in 0..6 {
        let moved = moved(members, &by, share);
        let tried: Vec<DVector<f64>> = moved.iter().map(|m| m.signature(stack)).collect();
        let mut left = stack.z.clone();
        for part in &tried {
            left -= part;
        }
        let gain = before - left.norm_squared();
        if gain > 0.0 {
            for (member, new) in members.iter_mut().zip(moved) {
                member.values = new.values;
            }
            parts.clone_from_slice(&tried);
            return gain > 1e-3;
        }
        share *= 0.5;
    }
    false
}

fn moved<'f>(members: &[Member<'f>], by: &[f64], share: f64) -> Vec<Member<'f>> {
    let mut by = by.iter();
    members
        .iter()
        .map(|member| {
            let mut values = member.values.clone();
            for (place, by) in member.active.iter().zip(by.by_ref()) {
                let of = parameter(member.instance, *place);
                values[*place] = (values[*place] + share * by).clamp(of.low, of.high);
            }
            Member {
                instance: member.instance,
                values,
                active: member.active.clone(),
            }
        })
        .collect()
}

/// Coverage factor of the intervals.
pub const COVERAGE: f64 = 1.96;

/// Standard uncertainty of each member's first value with its shares: that of the sum, where it takes the first value's
/// place among what is estimated.
fn of_wholes(
    stack: &Stack<'_>,
    members: &[Member<'_>],
    columns: &[DVector<f64>],
    left: &DVector<f64>,
) -> Vec<Option<f64>> {
    let mut first = 0;
    let firsts: Vec<usize> = members
        .iter()
        .map(|member| {
            let own = first;
            first += member.active.len();
            own
        })
        .collect();
    let mut summed = columns.to_vec();
    for (member, first) in members.iter().zip(&firsts) {
        for (column, place) in member.active.iter().enumerate() {
            if member.shares().any(|share| share == *place) {
                summed[first + column] -= &columns[*first];
            }
        }
    }
    if members
        .iter()
        .all(|member| member.shares().next().is_none())
    {
        return vec![None; members.len()];
    }
    let doubts = standard_uncertainties(stack, &DMatrix::from_columns(&summed), left);
    let of = |(member, first): (&Member<'_>, usize)| {
        member.shares().next()?;
        doubts.get(first).copied()
    };
    members.iter().zip(firsts).map(of).collect()
}

/// (2) and the intervals.
fn estimates(stack: &Stack<'_>, members: &[Member<'_>], parts: Vec<DVector<f64>>) -> Refit {
    let columns = jacobian(stack, members, &parts);
    let mut left = stack.z.clone();
    for part in &parts {
        left -= part;
    }
    let spread = if columns.is_empty() {
        vec![]
    } else {
        let known = known_of_shapes(members);
        uncertainties(stack, &DMatrix::from_columns(&columns), &left, &known)
    };
    let mut of_whole = of_wholes(stack, members, &columns, &left).into_iter();
    let mut spread = spread.into_iter();
    let estimates = members
        .iter()
        .zip(&parts)
        .map(|(member, part)| {
            let mut estimate = Estimate {
                low: member.values.clone(),
                high: member.values.clone(),
                at_bound: vec![false; member.values.len()],
                values: member.values.clone(),
                active: member.active.clone(),
                whole: of_whole.next().flatten().map(|u| {
                    let shares = member.shares().map(|place| member.values[place]);
                    let value = member.values[0] + shares.sum::<f64>();
                    [value, value - COVERAGE * u, value + COVERAGE * u]
                }),
                d: part.norm(),
            };
            for (&place, u) in member.active.iter().zip(spread.by_ref()) {
                let of = parameter(member.instance, place);
                let value = member.values[place];
                estimate.low[place] = value - COVERAGE * u;
                estimate.high[place] = value + COVERAGE * u;
                let near = 1e-6 * (of.high - of.low);
                estimate.at_bound[place] = value <= of.low + near || value >= of.high - near;
            }
            estimate
        })
        .collect();
    Refit {
        estimates,
        parts,
        jacobian: columns,
    }
}

/// Of (3): a shape that is hardly known is known to a factor of two.
const LARGEST_RELATIVE_U: f64 = std::f64::consts::LN_2;

/// 1/u_0^2 of (3) of every active value, in the order of members; 0 of a size.
fn known_of_shapes(members: &[Member<'_>]) -> Vec<f64> {
    let of = |member: &Member<'_>, place: usize| {
        let grid = parameter(member.instance, place).role.grid()?;
        let ([first, second, ..], [.., before, last]) = (grid, grid) else {
            return None;
        };
        let at = member.values[place];
        let range = last.powi(2) / before / (first.powi(2) / second);
        let u = at * (range.ln() / 12_f64.sqrt()).min(LARGEST_RELATIVE_U);
        (*first > 0.0 && at > 0.0).then(|| u.powi(-2))
    };
    let all = members.iter().flat_map(|member| {
        let places = member.active.iter();
        places.map(move |place| of(member, *place).unwrap_or(0.0))
    });
    all.collect()
}

/// Greater of the sandwich by run and of the model, for each column.
pub fn standard_uncertainties(
    stack: &Stack<'_>,
    columns: &DMatrix<f64>,
    left: &DVector<f64>,
) -> Vec<f64> {
    uncertainties(stack, columns, left, &vec![0.0; columns.ncols()])
}

/// The same where so much is known of each column besides.
fn uncertainties(
    stack: &Stack<'_>,
    columns: &DMatrix<f64>,
    left: &DVector<f64>,
    known: &[f64],
) -> Vec<f64> {
    let mut normal = Normal::new(columns, left);
    for (place, known) in known.iter().enumerate() {
        normal.gram[(place, place)] += known;
    }
    let inverse = normal.inverse(&(0..columns.ncols()).collect::<Vec<_>>());
    let mut scores = vec![DVector::<f64>::zeros(columns.ncols()); stack.runs.len()];
    for block in &stack.rows.blocks {
        let Some(cluster) = stack.runs.iter().position(|run| *run == block.run) else {
            continue;
        };
        let range = block.range();
        let part = columns.rows(range.start, range.len());
        scores[cluster] += part.tr_mul(&left.rows(range.start, range.len()));
    }
    let clusters = count(stack.runs.len());
    let small = clusters / (clusters - 1.0).max(1.0);
    let mut meat = DMatrix::zeros(columns.ncols(), columns.ncols());
    for score in &scores {
        meat += score * score.transpose() * small;
    }
    let sandwich = &inverse * meat * &inverse;
    (0..columns.ncols())
        .map(|k| inverse[(k, k)].max(sandwich[(k, k)]).max(0.0).sqrt())
        .collect()
}

#[cfg(test)]
mod tests {
    use metrology::Axis;
    use twin::effects::{self, Target};

    use super::*;

    /// By hand: the grid of widths goes from 3 to 48 ms, one step beyond it from 1.5 to 96; ln 64 / sqrt 12 = 1.20 is more than ln 2.
    #[test]
    fn eq3_a_width_is_known_to_a_factor_of_two_and_a_height_not_at_all() {
        let instance = Instance {
            kind: effects::kind("reversal_spike").expect("in the catalogue"),
            target: Target::Axis(Axis::X),
            begins: None,
        };
        let member = Member {
            instance: &instance,
            values: vec![5.0, 20.0, 0.01],
            active: vec![0, 1],
        };
        let [height, width] = known_of_shapes(&[member])[..] else {
            panic!("two values");
        };
        assert!(height.abs() < 1e-12, "{height}");
        assert!(
            (width.sqrt().recip() - 20.0 * 2.0_f64.ln()).abs() < 1e-9,
            "{width}"
        );
    }
}
