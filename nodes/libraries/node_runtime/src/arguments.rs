//! The arguments that every ROS 2 program takes: `--ros-args … [--]`, as `rcl` reads them.

use std::path::PathBuf;

use crate::environment::{ENCLAVE, is_enclave};
use crate::names::RemapRule;
use crate::setup::Tree;

/// What a program was told on its command line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Arguments {
    /// Topic, service, node-name and namespace rules, in order; the first that fits wins.
    pub remaps: Vec<RemapRule>,
    /// Parameter files and single values in order; a later one overrides an earlier one.
    pub parameters: Vec<ParameterSource>,
    /// `--log-level LEVEL` and `--log-level NAME:=LEVEL`.
    pub log_levels: Vec<(Option<String>, String)>,
    /// `--enclave NAME`: where the credentials of DDS Security are.
    pub enclave: Option<String>,
    /// `--enable-…-logs` and `--disable-…-logs`.
    pub log_outputs: LogOutputs,
}

/// Where log lines go; of what is told twice the last holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogOutputs {
    /// To `/rosout`; without it a node does not publish there at all.
    pub rosout: bool,
    /// To the console.
    pub stdout: bool,
    /// To a file of a logging library. There is none here: nothing follows from it.
    pub external_lib: bool,
}

impl Default for LogOutputs {
    fn default() -> Self {
        Self {
            rosout: true,
            stdout: true,
            external_lib: true,
        }
    }
}

impl LogOutputs {
    /// Takes one of `rcl`'s switches; whether it is one.
    fn take(&mut self, argument: &str) -> bool {
        let (is_wanted, output) = if let Some(output) = argument.strip_prefix("--enable-") {
            (true, output)
        } else if let Some(output) = argument.strip_prefix("--disable-") {
            (false, output)
        } else {
            return false;
        };
        let told = match output {
            "rosout-logs" => &mut self.rosout,
            "stdout-logs" => &mut self.stdout,
            "external-lib-logs" => &mut self.external_lib,
            _ => return false,
        };
        *told = is_wanted;
        true
    }
}

/// One `--params-file` or `-p`.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterSource {
    /// A parameter file.
    File(PathBuf),
    /// One value, for every node of the process or for the one that is named.
    Value {
        /// Which node.
        node: Option<String>,
        /// Name, nested keys joined by dots.
        name: String,
        /// Its value.
        value: Tree,
    },
}

/// An argument that cannot be understood.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UsageError {
    /// Outside of `--ros-args`, which is where all the arguments of a node go.
    #[error("argument `{argument}` is unknown: a node takes --ros-args only")]
    OutsideRosArgs {
        /// As given.
        argument: String,
    },
    /// Inside of `--ros-args`, but none of them.
    #[error(
        "ROS argument `{argument}` is unknown: -r|--remap FROM:=TO, -p|--param NAME:=VALUE, \
         --params-file FILE, --log-level [NAME:=]LEVEL, -e|--enclave NAME, \
         --log-config-file FILE, --log-file-name NAME (without effect), \
         --enable-OUTPUT-logs, --disable-OUTPUT-logs with rosout, stdout or external-lib"
    )]
    UnknownRosArgument {
        /// As given.
        argument: String,
    },
    /// The last argument needs another.
    #[error("ROS argument `{argument}` needs a value after it")]
    MissingValue {
        /// As given.
        argument: String,
    },
    /// A rule without `:=`, or with an impossible name.
    #[error("remap rule `{rule}`: {reason}")]
    BadRemap {
        /// As given.
        rule: String,
        /// What is wrong.
        reason: String,
    },
    /// A parameter without `:=`, or with a value that is no YAML.
    #[error("parameter `{parameter}`: {reason}")]
    BadParameter {
        /// As given.
        parameter: String,
        /// What is wrong.
        reason: String,
    },
    /// None that can be a folder of a keystore.
    #[error("enclave `{enclave}`: must be {ENCLAVE}")]
    BadEnclave {
        /// As given.
        enclave: String,
    },
    /// None of the levels of ROS.
    #[error("log level `{level}`: must be debug, info, warn, error or fatal")]
    BadLevel {
        /// As given.
        level: String,
    },
}

const LEVELS: [&str; 6] = ["trace", "debug", "info", "warn", "error", "fatal"];

impl Arguments {
    /// Reads the arguments after the program's name.
    ///
    /// # Errors
    /// At the first argument that cannot be understood.
    pub fn parse<I>(arguments: I) -> Result<Self, UsageError>
    where
        I: IntoIterator<Item = String>,
    {
        let mut parsed = Self::default();
        let mut inside = false;
        let mut arguments = arguments.into_iter();
        while let Some(argument) = arguments.next() {
            match (inside, argument.as_str()) {
                (_, "--ros-args") => inside = true,
                (true, "--") => inside = false,
                (false, _) => return Err(UsageError::OutsideRosArgs { argument }),
                (true, _) => parsed.one(argument, &mut arguments)?,
            }
        }
        Ok(parsed)
    }

    fn one(
        &mut self,
        argument: String,
        rest: &mut impl Iterator<Item = String>,
    ) -> Result<(), UsageError> {
        if self.log_outputs.take(&argument) {
            return Ok(());
        }
        let take: fn(&mut Self, String) -> Result<(), UsageError> = match argument.as_str() {
            "-r" | "--remap" => Self::remap,
            "-p" | "--param" => Self::parameter,
            "--params-file" => |parsed, value| {
                parsed.parameters.push(ParameterSource::File(value.into()));
                Ok(())
            },
            "--log-level" => Self::log_level,
            "-e" | "--enclave" => Self::enclave,
            // Of the file of a logging library, which is not written here.
            "--log-config-file" | "--log-file-name" => |_, _| Ok(()),
            _ => return Err(UsageError::UnknownRosArgument { argument }),
        };
        match rest.next() {
            Some(value) => take(self, value),
            None => Err(UsageError::MissingValue { argument }),
        }
    }

    fn remap(&mut self, rule: String) -> Result<(), UsageError> {
        let parsed = RemapRule::parse(&rule).map_err(|error| UsageError::BadRemap {
            rule,
            reason: error.to_string(),
        })?;
        self.remaps.push(parsed);
        Ok(())
    }

    fn parameter(&mut self, parameter: String) -> Result<(), UsageError> {
        let bad = |reason: &str| UsageError::BadParameter {
            parameter: parameter.clone(),
            reason: reason.to_owned(),
        };
        let (name, text) = parameter
            .split_once(":=")
            .ok_or_else(|| bad("needs NAME:=VALUE"))?;
        let (node, name) = match name.split_once(':') {
            Some((node, name)) => (Some(node.to_owned()), name),
            None => (None, name),
        };
        if name.is_empty() {
            return Err(bad("the name is empty"));
        }
        let value = Tree::from_yaml(text).map_err(|error| bad(&error.rule))?;
        self.parameters.push(ParameterSource::Value {
            node,
            name: name.to_owned(),
            value,
        });
        Ok(())
    }

    fn enclave(&mut self, enclave: String) -> Result<(), UsageError> {
        if !is_enclave(&enclave) {
            return Err(UsageError::BadEnclave { enclave });
        }
        self.enclave = Some(enclave);
        Ok(())
    }

    fn log_level(&mut self, text: String) -> Result<(), UsageError> {
        let (name, level) = match text.split_once(":=") {
            Some((name, level)) => (Some(name.to_owned()), level),
            None => (None, text.as_str()),
        };
        let level = level.to_ascii_lowercase();
        if !LEVELS.contains(&level.as_str()) {
            return Err(UsageError::BadLevel { level });
        }
        self.log_levels.push((name, level));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(arguments: &[&str]) -> Result<Arguments, UsageError> {
        Arguments::parse(arguments.iter().map(|a| (*a).to_owned()))
    }

    #[test]
    fn everything_that_launch_passes_is_read() {
        let parsed = parse(&[
            "--ros-args",
            "-r",
            "__node:=bed",
            "-r",
            "__ns:=/cell",
            "-p",
            "rate_hz:=10.0",
            "-p",
            "probe:names:=[a, b]",
            "--params-file",
            "x.yaml",
            "--log-level",
            "DEBUG",
            "--",
        ])
        .unwrap();
        let names = crate::names::NodeNames::new("probe", &parsed.remaps).unwrap();
        assert_eq!(names.fully_qualified(), "/cell/bed");
        assert_eq!(parsed.parameters.len(), 3);
        assert_eq!(
            parsed.parameters[1],
            ParameterSource::Value {
                node: Some("probe".into()),
                name: "names".into(),
                value: Tree::List(vec![Tree::String("a".into()), Tree::String("b".into())]),
            }
        );
        assert_eq!(parsed.log_levels, [(None, "debug".to_owned())]);
    }

    #[test]
    fn switches_of_log_outputs_take_no_value_and_the_last_one_holds() {
        let untold = parse(&[]).unwrap().log_outputs;
        assert!(untold.rosout && untold.stdout && untold.external_lib);
        let told = parse(&[
            "--ros-args",
            "--disable-rosout-logs",
            "--disable-external-lib-logs",
            "--disable-stdout-logs",
            "--log-config-file",
            "logging.yaml",
            "-r",
            "__ns:=/cell",
            "--log-file-name",
            "cell",
            "--enable-stdout-logs",
        ])
        .unwrap();
        let outputs = LogOutputs {
            rosout: false,
            stdout: true,
            external_lib: false,
        };
        assert_eq!(told.log_outputs, outputs);
        assert_eq!(told.remaps.len(), 1);
    }

    #[test]
    fn what_is_not_known_is_refused_by_name() {
        for (arguments, named) in [
            (&["--fast"][..], "--fast"),
            (&["--ros-args", "--fast"], "--fast"),
            (&["--ros-args", "-p"], "-p"),
            (&["--ros-args", "--log-config-file"], "--log-config-file"),
            (&["--ros-args", "-p", "rate"], "rate"),
            (&["--ros-args", "-p", "rate:=[1"], "rate:=[1"),
            (&["--ros-args", "-r", "a b:=c"], "a b:=c"),
            (&["--ros-args", "--log-level", "loud"], "loud"),
            (&["--ros-args", "--disable-logs"], "--disable-logs"),
            (&["--disable-rosout-logs"], "--disable-rosout-logs"),
            (&["--ros-args", "--enclave", "/../keys"], "/../keys"),
            (&["--ros-args", "--", "x"], "`x`"),
        ] {
            let error = parse(arguments).unwrap_err().to_string();
            assert!(error.contains(named), "{error} does not name {named}");
        }
    }
}
