//! The order of a subscription's messages.
//!
//! Numbers go from 1 to 4,294,967,295 and then begin again at 1. A message without changes (keep-alive) has the number
//! that the next one will have.
//!
//! # References
//! \[1\] OPC 10000-4, 5.14.1.1 and 7.25 NotificationMessage.

/// What a message means for the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// The next one.
    Next,
    /// Messages before it have not come: the first number, and how many.
    Behind {
        /// First number that has not come.
        from: u32,
        /// How many.
        count: u32,
    },
    /// It has come before.
    Known,
}

/// Watches the numbers of a subscription.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sequence {
    last: u32,
}

/// The number behind one.
const fn after(number: u32) -> u32 {
    match number {
        u32::MAX => 1,
        number => number + 1,
    }
}

impl Sequence {
    /// The number that comes next.
    pub(super) const fn expected(self) -> u32 {
        after(self.last)
    }

    /// Takes a number; `has_data`: whether the message has changes.
    pub(super) const fn take(&mut self, number: u32, has_data: bool) -> Place {
        let next = self.expected();
        let distance = number.wrapping_sub(next);
        // Half the circle back is the past.
        if distance > u32::MAX / 2 || number == 0 {
            return Place::Known;
        }
        let before = match number {
            1 => u32::MAX,
            number => number - 1,
        };
        // Nothing can be missing before the very first message, and no message has number 0.
        self.last = if has_data {
            number
        } else if number == 1 && self.last == 0 {
            0
        } else {
            before
        };
        if distance == 0 {
            Place::Next
        } else {
            Place::Behind {
                from: next,
                count: distance,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_in_order_follow_each_other_and_keep_alives_take_no_number() {
        let mut sequence = Sequence::default();
        for (number, has_data) in [
            (1, false),
            (1, true),
            (2, true),
            (3, false),
            (3, false),
            (3, true),
        ] {
            assert_eq!(sequence.take(number, has_data), Place::Next, "{number}");
        }
        assert_eq!(sequence.expected(), 4);
    }

    #[test]
    fn what_has_not_come_is_named_once_also_by_a_keep_alive() {
        let mut sequence = Sequence::default();
        sequence.take(1, true);
        let behind = Place::Behind { from: 2, count: 3 };
        assert_eq!(sequence.take(5, true), behind);
        assert_eq!(sequence.take(3, true), Place::Known);
        assert_eq!(sequence.take(5, true), Place::Known);
        let behind = Place::Behind { from: 6, count: 2 };
        assert_eq!(sequence.take(8, false), behind);
        assert_eq!(sequence.take(8, true), Place::Next);
    }

    #[test]
    fn numbers_begin_again_at_one() {
        let mut sequence = Sequence { last: u32::MAX - 1 };
        assert_eq!(sequence.take(u32::MAX, true), Place::Next);
        assert_eq!(sequence.take(1, false), Place::Next);
        assert_eq!(sequence.take(1, true), Place::Next);
        assert_eq!(sequence.take(u32::MAX, true), Place::Known);
        assert_eq!(sequence.take(0, true), Place::Known);
    }
}
