//! Which way an axis goes, by its command.
//!
//! A reversal counts once the command has come back by a threshold from the furthest point reached, so
//! that rounding of a standing command is no reversal.

use std::fmt;

/// Sense of motion along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Towards greater positions.
    Up,
    /// Towards smaller positions.
    Down,
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Up => "up",
            Self::Down => "down",
        })
    }
}

/// Follows a command and tells its direction; `None` until it has moved by the threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DirectionOfMotion {
    threshold_fm: i64,
    furthest_fm: Option<i64>,
    direction: Option<Direction>,
}

impl DirectionOfMotion {
    /// Nothing known yet.
    #[must_use]
    pub fn new(threshold_fm: i64) -> Self {
        Self {
            threshold_fm,
            furthest_fm: None,
            direction: None,
        }
    }

    /// The last direction.
    #[must_use]
    pub fn direction(&self) -> Option<Direction> {
        self.direction
    }

    /// The command is now at `position_fm` (up to 1 km); returns its direction.
    pub fn advance(&mut self, position_fm: i64) -> Option<Direction> {
        let Some(furthest_fm) = self.furthest_fm else {
            self.furthest_fm = Some(position_fm);
            return None;
        };
        let gone_fm = position_fm.saturating_sub(furthest_fm);
        let turned = match self.direction {
            Some(Direction::Up) if gone_fm > 0 => Some(Direction::Up),
            Some(Direction::Down) if gone_fm < 0 => Some(Direction::Down),
            _ if gone_fm >= self.threshold_fm => Some(Direction::Up),
            _ if gone_fm <= -self.threshold_fm => Some(Direction::Down),
            _ => None,
        };
        if turned.is_some() {
            self.furthest_fm = Some(position_fm);
            self.direction = turned;
        }
        self.direction
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reversal_counts_after_its_threshold_from_the_furthest_point() {
        let mut motion = DirectionOfMotion::new(100);
        let told: Vec<_> = [0, 99, 100, 5000, 4950, 4999, 4901, 4900, 4800, 4899, 4900]
            .into_iter()
            .map(|position_fm| motion.advance(position_fm))
            .collect();
        let (up, down) = (Some(Direction::Up), Some(Direction::Down));
        assert_eq!(told, [None, None, up, up, up, up, up, down, down, down, up]);
    }
}
