//! Readings of a bag without a single begin of a run: they belong to no test, and nothing of them is evaluated.

use std::collections::BTreeMap;

use abbe_msgs::topics;
use replayer::{Account, Place, Reason, Taken};

/// Readings that stand in no run, by topic: how many, and the first of them.
#[derive(Debug, Default)]
pub(super) struct Outside {
    has_run: bool,
    readings: BTreeMap<String, (u64, Place)>,
}

impl Outside {
    /// A message of any topic, while a run is under way or not.
    pub(super) fn message(&mut self, taken: &Taken<'_>, is_under_way: bool) {
        let is_reading = taken.is(&topics::LENGTH_POSITION)
            || taken.is(&topics::GRID_POSITION)
            || taken.is(&topics::ANGLE_POSITION);
        self.has_run |= is_under_way || taken.is(&topics::TEST_SEGMENT);
        if self.has_run || !is_reading {
            return;
        }
        match self.readings.get_mut(taken.topic()) {
            Some((n, _)) => *n += 1,
            None => {
                let first = (1, taken.place());
                self.readings.insert(taken.topic().to_owned(), first);
            }
        }
    }

    /// Counts the readings as left out, where the bag has no run at all.
    pub(super) fn finish(self, account: &mut Account) {
        if self.has_run {
            return;
        }
        for row in &mut account.topics {
            if let Some((n, first)) = self.readings.get(&row.topic) {
                row.take_back(Reason::NoBegin, *n, *first, || {
                    format!(
                        "the bag has no begin of a run, so these readings are of no test: record {} too",
                        topics::TEST_SEGMENT.name
                    )
                });
            }
        }
    }
}
