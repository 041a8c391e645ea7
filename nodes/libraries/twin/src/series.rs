//! Numbers along a run that are zero until somebody adds to them.
//!
//! One effect touches one or two of the two dozen series of a response. A series takes its memory when it is
//! first written to; read before, it is empty, which every reader takes for zeros.

use std::ops::{Deref, DerefMut};

/// A series of a known length, or nothing at all while it is zero everywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    length: usize,
    values: Vec<f64>,
}

impl Series {
    /// Zeros, this many.
    #[must_use]
    pub const fn zeros(length: usize) -> Self {
        Self {
            length,
            values: vec![],
        }
    }

    /// The values; none while all of them are zero.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        &self.values
    }
}

impl Deref for Series {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.values
    }
}

impl DerefMut for Series {
    fn deref_mut(&mut self) -> &mut [f64] {
        self.values.resize(self.length, 0.0);
        &mut self.values
    }
}

impl<'a> IntoIterator for &'a Series {
    type Item = &'a f64;
    type IntoIter = std::slice::Iter<'a, f64>;

    fn into_iter(self) -> Self::IntoIter {
        self.values.iter()
    }
}

impl<'a> IntoIterator for &'a mut Series {
    type Item = &'a mut f64;
    type IntoIter = std::slice::IterMut<'a, f64>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_taken_when_it_is_first_written_to() {
        let mut series = Series::zeros(3);
        assert!(series.is_empty());
        series[1] += 2.0;
        assert_eq!(series.as_slice(), [0.0, 2.0, 0.0]);
    }
}
