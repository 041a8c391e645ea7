//! Times that a log has covered: where its clock goes back, it covers some a second time, and the first counts.

use metrology::stamp::{Machine, Stamp};

/// First and last instant.
pub(super) type Piece = (Stamp<Machine>, Stamp<Machine>);

/// Times that were covered, as disjoint pieces in order.
#[derive(Debug, Default)]
pub(super) struct Once {
    pieces: Vec<Piece>,
}

impl Once {
    /// Whether `at` lies in a piece that was covered, its end left out.
    pub fn has(&self, at: Stamp<Machine>) -> bool {
        let place = self.pieces.partition_point(|(_, last)| *last <= at);
        self.pieces
            .get(place)
            .is_some_and(|(first, _)| *first <= at)
    }

    /// What of a time was not covered.
    pub fn missing(&self, from: Stamp<Machine>, to: Stamp<Machine>) -> Vec<Piece> {
        let mut missing = Vec::new();
        let mut begin = from;
        for &(first, last) in &self.pieces {
            if first > begin {
                missing.push((begin, first.min(to)));
            }
            begin = begin.max(last);
        }
        missing.push((begin, to));
        missing.retain(|(first, last)| first < last);
        missing
    }

    /// Notes a piece as covered; returns what of it is new.
    pub fn tell(&mut self, from: Stamp<Machine>, to: Stamp<Machine>) -> Vec<Piece> {
        if to <= from {
            return Vec::new();
        }
        let begin = self.pieces.partition_point(|(_, last)| *last < from);
        let end = self.pieces.partition_point(|(first, _)| *first <= to);
        let (mut new, mut told_to, mut whole) = (Vec::new(), from, (from, to));
        for &(first, last) in self.pieces.get(begin..end).unwrap_or_default() {
            if first > told_to {
                new.push((told_to, first));
            }
            told_to = told_to.max(last);
            whole = (whole.0.min(first), whole.1.max(last));
        }
        if to > told_to {
            new.push((told_to, to));
        }
        self.pieces.splice(begin..end, [whole]);
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_counts_once_however_often_it_is_told() {
        let at = Stamp::<Machine>::from_nanos;
        let mut once = Once::default();
        let mut tell = |from, to| -> Vec<(i64, i64)> {
            let new = once.tell(at(from), at(to));
            new.iter().map(|(a, b)| (a.nanos(), b.nanos())).collect()
        };
        assert_eq!(tell(10, 20), [(10, 20)]);
        assert_eq!(tell(20, 30), [(20, 30)]);
        assert_eq!(tell(50, 60), [(50, 60)]);
        assert_eq!(tell(5, 70), [(5, 10), (30, 50), (60, 70)]);
        assert_eq!(tell(5, 70), []);
        assert_eq!(tell(9, 3), []);
        assert_eq!(once.pieces, [(at(5), at(70))]);
        let missing = |from, to| -> Vec<(i64, i64)> {
            let all = once.missing(at(from), at(to));
            all.iter().map(|(a, b)| (a.nanos(), b.nanos())).collect()
        };
        assert_eq!(missing(0, 80), [(0, 5), (70, 80)]);
        assert_eq!(missing(10, 60), []);
        assert_eq!(missing(70, 75), [(70, 75)]);
        let has = [4, 5, 69, 70].map(|nanos| once.has(at(nanos)));
        assert_eq!(has, [false, true, true, false]);
    }
}
