//! Why nothing is read of a table.

use super::super::recognise::Recognised;
use super::super::{deviation_names, pass_names, unread};
use super::{names, sign};

/// The cells that stand in the way; without any, what is unsure about the names of columns.
pub fn in_words(found: &Recognised) -> String {
    // Names that stand for columns say nothing of them.
    if found.head_line == 0 {
        return format!(
            "no line of names: write a map that names the columns {} (docs/reference/scenario.md#import-map); `period_ms` of a log turns sample \
             numbers into times",
            names(found).join(", ")
        );
    }
    unread::in_words(found).unwrap_or_else(|| {
        format!(
            "{}{}{}columns {}: neither targets with deviations, nor a time with a displacement, nor angles with radial deviations: write a map (docs/reference/scenario.md#import-map)",
            pass_names::unsure(found),
            sign::unsure(found),
            deviation_names::unsure(found),
            names(found).join(", ")
        )
    })
}
