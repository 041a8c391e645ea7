//! How the lost motion of a named effect varies along its axis.

use crate::judgement::cause::Found;
use crate::noise::stack::Stack;
use crate::report::figures::Note;
use crate::search::rows::count;

/// The effect whose size may differ from place to place, and how its parameters begin that say so.
const LOST_MOTION: (&str, &str) = ("backlash", "free_by_place");
/// Rows near the reversals, where the play is not yet taken up, are not looked at: this share at either end.
const ENDS_SHARE: f64 = 0.02;

/// A note for every named lost motion that has another size at other places.
pub(crate) fn notes(stack: &Stack<'_>, found: &Found) -> Vec<Note> {
    let (id, parameter) = LOST_MOTION;
    let named = found.named().filter_map(|member| {
        let instance = found.instance(member);
        let own = instance.kind.parameters.iter().chain(instance.kind.free);
        let names: Vec<&str> = own.map(|p| p.name).collect();
        let is_by_place = |place: &usize| names[*place].starts_with(parameter);
        let varies = instance.kind.id == id && member.estimate.active.iter().any(is_by_place);
        let effect = varies.then(|| instance.effect(&member.estimate.values))?;
        // Half of the play on either side.
        let told = stack.simulate(&[&*effect]);
        let widths_um = told
            .iter()
            .filter(|mm| **mm != 0.0)
            .map(|mm| 2e3 * mm.abs());
        let [from_um, to_um] = range(widths_um.collect())?;
        Some(Note::Varies {
            effect: instance.name(),
            from_um,
            to_um,
        })
    });
    named.collect()
}

/// Least and greatest of some values beside a few at either end.
fn range(mut values: Vec<f64>) -> Option<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a length, rounded down"
    )]
    let left_out = (ENDS_SHARE * count(values.len())) as usize;
    let last = values.len().checked_sub(left_out + 1)?;
    Some([*values.get(left_out)?, *values.get(last)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_leaves_out_a_few_at_either_end() {
        let mut values: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(range(values.clone()), Some([2.0, 97.0]));
        values.truncate(9);
        assert_eq!(range(values), Some([0.0, 8.0]));
        assert_eq!(range(vec![]), None);
    }
}
