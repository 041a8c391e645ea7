//! Which runs of a positioning test are whole: one that was broken off would take its targets from all others.

/// Readings that a broken-off run lacks at least.
const LEAST_LACKED: usize = 2;
/// A run with fewer than this share of a complete run's readings was broken off: three of four.
const WHOLE_SHARE: [usize; 2] = [3, 4];

/// Readings of a complete run among runs with these numbers of readings: at least half of them have so many or more.
#[must_use]
pub fn n_of_complete(mut counts: Vec<usize>) -> usize {
    counts.sort_unstable();
    counts.get(counts.len() / 2).copied().unwrap_or(0)
}

/// Whether a run with `n` readings was broken off, where a complete one has `n_complete`.
#[must_use]
pub const fn is_broken_off(n: usize, n_complete: usize) -> bool {
    let [share, of] = WHOLE_SHARE;
    n + LEAST_LACKED <= n_complete && of * n < share * n_complete
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_with_clearly_fewer_readings_than_most_was_broken_off() {
        for (counts, wanted) in [
            (&[14, 14, 14, 14, 6][..], &[6][..]),
            (&[14, 14, 14, 14, 7], &[7]),
            (&[14, 14, 14, 14, 10], &[10]),
            (&[14, 14, 14, 14, 11], &[]),
            (&[14, 3], &[3]),
            (&[0, 14, 14], &[0]),
            (&[6, 14, 14, 5], &[6, 5]),
            (&[3, 3, 2], &[]),
            (&[3, 3, 1], &[1]),
            (&[14], &[]),
            (&[], &[]),
        ] {
            let n_complete = n_of_complete(counts.to_vec());
            let found: Vec<usize> = { counts.iter().copied() }
                .filter(|n| is_broken_off(*n, n_complete))
                .collect();
            assert_eq!(found, wanted, "{counts:?}");
        }
    }
}
