//! The conditions that a laser's program records beside its readings: temperatures, expansion, and when it began.

use super::times;

/// Readings of this and less are of a thermometer that was not connected, °C.
const NOT_CONNECTED_DEGC: f64 = -10.0;

/// Temperatures and the coefficient of expansion that the program used, each at begin and end. `recorded` gives the value of a key.
pub fn in_words<'t>(recorded: impl Fn(&str) -> &'t str) -> Option<String> {
    let of = |(key, name, unit): (&str, &str, &str)| {
        let words = recorded(key).split_whitespace().take(2);
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        let [begin, end] = numbers.as_slice() else {
            return None;
        };
        let is_read = *begin > NOT_CONNECTED_DEGC;
        is_read.then(|| format!("{name} {begin:.2} to {end:.2} {unit}"))
    };
    let all = [
        ("air temp", "air", "°C"),
        ("mat temp 1", "material", "°C"),
        ("mat temp 2", "material (2)", "°C"),
        ("mat temp 3", "material (3)", "°C"),
        ("exp coeff", "expansion", "µm/(m K)"),
    ];
    let found: Vec<String> = all.into_iter().filter_map(of).collect();
    (!found.is_empty()).then(|| {
        let found = found.join(", ");
        format!(
            "the file states {found}: its deviations are as the instrument's program corrected them"
        )
    })
}

/// When a measurement began, s since 1970: by the environment's record, else by the date that was entered. Clocks without a
/// zone are taken for UTC.
pub fn start_s([recorded, entered]: [&str; 2]) -> Option<f64> {
    let recorded = recorded.split('"').nth(1).and_then(iso);
    let mut texts = recorded.into_iter().chain([entered.to_owned()]);
    texts.find_map(|text| {
        let seconds = times::of_text(&text).ok().flatten();
        seconds.filter(|seconds| *seconds > 0.0)
    })
}

/// `10:46 Dec 12 2016` as `2016-12-12 10:46:00`.
fn iso(text: &str) -> Option<String> {
    const MONTHS: [&str; 12] = [
        "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
    ];
    let words: Vec<&str> = text.split_whitespace().collect();
    let [clock, month, day, year] = words.as_slice() else {
        return None;
    };
    let month = month.to_lowercase();
    let month = MONTHS.iter().position(|known| *known == month)? + 1;
    let day: u32 = day.parse().ok()?;
    Some(format!("{year}-{month:02}-{day:02} {clock}:00"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_begin_is_that_of_the_record_else_the_one_entered_else_unknown() {
        let recorded = "\"10:46 Dec 12 2016\" \"11:01 Dec 12 2016\"";
        // By `date -u -d "2016-12-12 10:46" +%s`.
        assert_eq!(
            start_s([recorded, "2026-01-05 08:00:00"]),
            Some(1_481_539_560.0)
        );
        assert_eq!(start_s(["", "2026-01-05 08:00:00"]), Some(1_767_600_000.0));
        for odd in [
            "10:46 Dec 2016",
            "\"10:46 Dez 12 2016\"",
            "\"",
            "\"x y z w\"",
        ] {
            assert_eq!(start_s([odd, "soon"]), None, "{odd}");
        }
    }
}
