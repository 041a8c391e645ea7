//! What was touched and moved during the session, for itself: a block whose clamp slipped.
//!
//! A change of touches that no effect explains is a place that moved. From the first run after it on the place floats, as it
//! does from one set-up to the next.

use twin::{Session, Touch};

use super::Change;
use crate::noise::repeats;
use crate::noise::stack::Stack;

/// A place of touches that floats from a run on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moved {
    touch: Touch,
    setup_id: u32,
    /// The first run after it moved, by its number.
    from_run: u32,
}

/// The places that some changes moved.
pub(crate) fn of<'c>(session: &Session, changes: impl Iterator<Item = &'c Change>) -> Vec<Moved> {
    let of_change = |change: &'c Change| {
        let first = &session.runs[change.between[1]].segment;
        let moved = move |touch: &Touch| Moved {
            touch: touch.clone(),
            setup_id: first.setup_id,
            from_run: first.run,
        };
        change.touches.iter().map(moved)
    };
    changes.flat_map(of_change).collect()
}

/// What `of` makes of a session, with what of the changes moved for itself: first all stands but single things that are touched,
/// then, where a change `is_left`, it moved too. The second session has a set-up of its own after each change, if there is one.
pub(crate) fn standing_first<R, E>(
    (session, anew): (&Session, Option<&Session>),
    changes: &[Change],
    of: impl Fn(&Session, &[&Change]) -> Result<R, E>,
    is_left: impl Fn(&R, &Change) -> bool,
) -> Result<R, E> {
    let moved: Vec<&Change> = changes.iter().filter(|own| own.is_touched_alone).collect();
    let (alone, offered): (Vec<_>, Vec<_>) = moved.into_iter().partition(|own| own.is_set_up);
    let one = of(session, &alone)?;
    if anew.is_none() && offered.is_empty() {
        return Ok(one);
    }
    let mut moved: Vec<&Change> = offered
        .into_iter()
        .filter(|own| is_left(&one, own))
        .collect();
    let has_more = !moved.is_empty();
    moved.extend(alone);
    let mut standing = changes.iter().filter(|own| !own.is_touched_alone);
    match anew {
        Some(anew) if standing.any(|own| is_left(&one, own)) => of(anew, &moved),
        _ if has_more => of(session, &moved),
        _ => Ok(one),
    }
}

impl Moved {
    /// 1 at its touches in runs from its own on, 0 elsewhere.
    pub(crate) fn column(&self, stack: &Stack<'_>) -> Vec<f64> {
        let mut column = vec![0.0; stack.rows.len];
        for block in &stack.rows.blocks {
            let run = &stack.session.runs[block.run];
            let segment = &run.segment;
            if segment.run < self.from_run || segment.setup_id != self.setup_id {
                continue;
            }
            for (row, value) in block.rows.iter().zip(&mut column[block.range()]) {
                let touch = row.touch.and_then(|at| run.touches.get(at));
                let is_own = touch.is_some_and(|touch| repeats::is_same_touch(&self.touch, touch));
                *value = f64::from(u8::from(is_own));
            }
        }
        column
    }
}
