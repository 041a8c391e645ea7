//! Handing over in turns: a machine that reports much at once leaves time for everything else.

use std::collections::VecDeque;

/// How much is handed over in one turn at most.
pub const PER_TURN: usize = 1_000;

/// What waits to be handed over, in its order.
#[derive(Debug)]
pub struct Turns<T> {
    waiting: VecDeque<T>,
}

impl<T> Default for Turns<T> {
    fn default() -> Self {
        Self {
            waiting: VecDeque::new(),
        }
    }
}

impl<T> Turns<T> {
    /// Adds one behind the others.
    pub fn put(&mut self, one: T) {
        self.waiting.push_back(one);
    }

    /// Whether nothing waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Whether a whole turn waits: nothing more should be taken before it is handed over.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.waiting.len() >= PER_TURN
    }

    /// Hands over one turn.
    pub fn hand_over(&mut self, out: &mut Vec<T>) {
        let n = self.waiting.len().min(PER_TURN);
        out.extend(self.waiting.drain(..n));
    }

    /// Hands over one last turn; how many were left behind it and are gone.
    pub fn end(&mut self, out: &mut Vec<T>) -> usize {
        self.hand_over(out);
        let left = self.waiting.len();
        self.waiting.clear();
        left
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn much_is_handed_over_in_turns_in_its_order_and_the_end_waits_for_one() {
        let mut turns = Turns::default();
        (0..2_500).for_each(|one| turns.put(one));
        assert!(turns.is_full());
        let mut out = vec![];
        turns.hand_over(&mut out);
        assert_eq!(out, (0..1_000).collect::<Vec<_>>());
        out.clear();
        assert_eq!(turns.end(&mut out), 500);
        assert_eq!(out, (1_000..2_000).collect::<Vec<_>>());
        assert!(turns.is_empty());
    }
}
