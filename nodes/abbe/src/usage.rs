//! Arguments that can be read and cannot be used: said as clap says it, with exit code 2.

use std::fmt::Display;

use clap::CommandFactory;
use clap::error::ErrorKind;

/// Magnitude of any number that has a unit: products of a few of them stay finite.
pub const GREATEST_NUMBER: f64 = 1e12;

/// Exit code for arguments that cannot be understood or used.
pub const USAGE: u8 = 2;

/// Why the arguments of `verb` cannot be used, as an error with which the program ends with [`USAGE`].
pub fn refused(verb: &str, reason: impl Display) -> anyhow::Error {
    let mut program = crate::Arguments::command();
    program.build();
    let error = match program.find_subcommand_mut(verb) {
        Some(command) => command.error(ErrorKind::ValueValidation, reason),
        None => program.error(ErrorKind::ValueValidation, reason),
    };
    error.into()
}

/// The help of a verb, as clap words it.
pub fn help_of(verb: &str) -> String {
    let mut program = crate::Arguments::command();
    program.build();
    let command = program.find_subcommand_mut(verb);
    command.map_or_else(String::new, |command| command.render_help().to_string())
}

/// A finite number above 0 and at most [`GREATEST_NUMBER`].
///
/// # Errors
/// Says what is wanted.
pub fn above_zero(text: &str) -> Result<f64, &'static str> {
    let number = text.parse().ok();
    number
        .filter(|number: &f64| *number > 0.0 && *number <= GREATEST_NUMBER)
        .ok_or("must be a finite number above 0, at most 1e12")
}

/// The absolute name of a topic, or a pattern of such names: any other would be that of no topic.
///
/// # Errors
/// Says what is wanted.
pub fn topics(text: &str) -> Result<String, &'static str> {
    if text.starts_with(['/', '*']) {
        Ok(text.to_owned())
    } else {
        Err(
            "names of topics are absolute: must begin with / (or with *, which stands for any run of characters)",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_shows_the_reason_and_how_the_verb_is_used() {
        let error = refused("play", "rate = -2: must be from 0 to 1000");
        let error: clap::Error = error.downcast().unwrap();
        assert_eq!(error.exit_code(), i32::from(USAGE));
        let said = error.to_string();
        assert!(
            said.starts_with("error: rate = -2: must be from 0 to 1000\n"),
            "{said}"
        );
        assert!(said.contains("Usage: abbe play [OPTIONS] <BAG>"), "{said}");
        assert!(said.contains("try '--help'"), "{said}");
    }

    #[test]
    fn a_name_that_no_topic_can_have_is_refused() {
        for text in ["/axes/state", "*", "*state", "/axes/*"] {
            assert_eq!(topics(text).as_deref(), Ok(text));
        }
        for text in ["axes/state", "axes/*", ""] {
            assert!(topics(text).is_err(), "{text}");
        }
    }

    #[test]
    fn numbers_that_are_none_or_not_above_zero_are_refused() {
        assert!(above_zero("0.5").is_ok_and(|number| (number - 0.5).abs() < 1e-12));
        for text in ["0", "-0.0", "-1", "nan", "inf", "1e400", "1e13", "wide", ""] {
            assert!(above_zero(text).is_err(), "{text}");
        }
    }
}
