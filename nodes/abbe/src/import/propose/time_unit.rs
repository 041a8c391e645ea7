//! The unit of a column of times, and from when it counts.

use anyhow::Result;

use super::super::recognise::Known;
use super::super::times;
use super::super::units::{Kind, Unit};
use super::{Text, epochs};

impl Text<'_> {
    /// The unit of times that are numbers: named, or that of an epoch.
    pub(super) fn time_unit(&mut self, time: &Known) -> Result<()> {
        if time.unknown.is_some() {
            return self.unit(time, Unit::Second, None);
        }
        let first = time.numbers.first().copied().unwrap_or(0.0);
        let named = time.unit.filter(|unit| unit.kind() == Kind::Time);
        if named.is_none() {
            self.needed.extend(epochs::check(time, first)?);
        }
        let of_epoch = || {
            let (word, _) = metrology::epoch::likely_unit(first)?;
            match word {
                "milliseconds" => Some(Unit::Ms),
                "microseconds" => Some(Unit::Us),
                "nanoseconds" => Some(Unit::Ns),
                _ => None,
            }
        };
        let known = named.or_else(of_epoch);
        if known.is_none() {
            let likely = times::likely(&time.numbers);
            let taken = likely.unwrap_or(Unit::Second);
            let as_seconds = match likely {
                Some(_) => format!("; {}", times::in_words(&time.numbers, Unit::Second)),
                None => String::new(),
            };
            self.needed.push(format!(
                "column \"{}\": no unit in its name, read in {}: {}{as_seconds}; correct it where it is another",
                time.name,
                taken.name(),
                times::in_words(&time.numbers, taken),
            ));
        }
        let unit = known
            .or_else(|| times::likely(&time.numbers))
            .unwrap_or(Unit::Second);
        let first_s = unit.convert(first, Unit::Second);
        self.needed.extend(epochs::check_gps(time, first_s));
        match epochs::of_excel(unit, first) {
            Some(begin_s) => {
                self.start_s = begin_s;
                let said = format!(
                    "column \"{}\": days since 1899-12-30, as Excel counts them",
                    time.name
                );
                self.recognised.push(said);
            }
            None if first_s > 6e8 => self.start_s = first_s,
            None => {}
        }
        let told = Known {
            unit: Some(unit),
            ..time.clone()
        };
        self.unit(&told, Unit::Second, None)
    }
}
