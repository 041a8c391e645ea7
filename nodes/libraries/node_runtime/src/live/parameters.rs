//! The parameter services of a node, and its part of `/parameter_events`.
//!
//! ros2-client's own server answers in Fast DDS's mapping only and lets values be changed. Here
//! values are frozen: a bag's outputs follow from its inputs and the parameters that it records.

use abbe_msgs::rcl_interfaces::msg::{
    FloatingPointRange, IntegerRange, ListParametersResult, Parameter as ParameterMessage,
    ParameterDescriptor, ParameterEvent, ParameterType, ParameterValue, SetParametersResult,
};
use abbe_msgs::rcl_interfaces::srv::{
    DescribeParameters, DescribeParametersRequest, DescribeParametersResponse, GetParameterTypes,
    GetParameterTypesRequest, GetParameterTypesResponse, GetParameters, GetParametersRequest,
    GetParametersResponse, ListParameters, ListParametersRequest, ListParametersResponse,
    SetParameters, SetParametersAtomically, SetParametersAtomicallyRequest,
    SetParametersAtomicallyResponse, SetParametersRequest, SetParametersResponse,
};
use abbe_msgs::{Message, Service, WireError, from_cdr, to_cdr};
use metrology::Stamp;
use metrology::stamp::Host;

use super::service::shared;
use crate::clock;
use crate::node::Bytes;
use crate::parameter::{Parameter, Value};

/// One of the six services.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ParameterService {
    List,
    Get,
    Types,
    Describe,
    Set,
    SetAtomically,
}

impl ParameterService {
    /// Each with its name below the node and its type.
    pub const ALL: [(Self, &'static str, &'static str); 6] = [
        (Self::List, "~/list_parameters", ListParameters::TYPE_NAME),
        (Self::Get, "~/get_parameters", GetParameters::TYPE_NAME),
        (
            Self::Types,
            "~/get_parameter_types",
            GetParameterTypes::TYPE_NAME,
        ),
        (
            Self::Describe,
            "~/describe_parameters",
            DescribeParameters::TYPE_NAME,
        ),
        (Self::Set, "~/set_parameters", SetParameters::TYPE_NAME),
        (
            Self::SetAtomically,
            "~/set_parameters_atomically",
            SetParametersAtomically::TYPE_NAME,
        ),
    ];

    /// The answer to a request.
    ///
    /// # Errors
    /// When the request is malformed.
    pub fn answer(self, parameters: &[Parameter], bytes: &[u8]) -> Result<Bytes, WireError> {
        let table = Table(parameters);
        let answer = match self {
            Self::List => {
                let request: ListParametersRequest = from_cdr(bytes)?;
                at_most::<ListParametersRequest>("prefixes", request.prefixes.len())?;
                to_cdr(&table.list(&request))
            }
            Self::Get => {
                let GetParametersRequest { names } = from_cdr(bytes)?;
                at_most::<GetParametersRequest>("names", names.len())?;
                let values = names.iter().map(|name| table.value(name)).collect();
                to_cdr(&GetParametersResponse { values })
            }
            Self::Types => {
                let GetParameterTypesRequest { names } = from_cdr(bytes)?;
                at_most::<GetParameterTypesRequest>("names", names.len())?;
                let types = names.iter().map(|name| table.value(name).r#type).collect();
                to_cdr(&GetParameterTypesResponse { types })
            }
            Self::Describe => {
                let DescribeParametersRequest { names } = from_cdr(bytes)?;
                at_most::<DescribeParametersRequest>("names", names.len())?;
                let descriptors = names.iter().map(|name| table.describe(name)).collect();
                to_cdr(&DescribeParametersResponse { descriptors })
            }
            Self::Set => {
                let SetParametersRequest { parameters } = from_cdr(bytes)?;
                at_most::<SetParametersRequest>("parameters", parameters.len())?;
                let results = parameters.iter().map(|p| table.refuse(p)).collect();
                to_cdr(&SetParametersResponse { results })
            }
            Self::SetAtomically => {
                let SetParametersAtomicallyRequest { parameters } = from_cdr(bytes)?;
                let accepted = SetParametersResult {
                    successful: true,
                    ..Default::default()
                };
                let result = parameters
                    .iter()
                    .map(|p| table.refuse(p))
                    .next()
                    .unwrap_or(accepted);
                to_cdr(&SetParametersAtomicallyResponse { result })
            }
        };
        Ok(shared(&answer))
    }
}

/// Names in one request: a node has some hundred parameters, and each name is answered by a text.
const MAX_REQUESTED_NAMES: usize = 10_000;

/// Refuses a request of more names than that.
fn at_most<M: Message>(field: &'static str, n: usize) -> Result<(), WireError> {
    if n <= MAX_REQUESTED_NAMES {
        return Ok(());
    }
    Err(WireError::TooMany {
        message: M::TYPE_NAME,
        field,
        n,
        what: "entries",
        greatest: MAX_REQUESTED_NAMES,
    })
}

struct Table<'p>(&'p [Parameter]);

impl Table<'_> {
    fn find(&self, name: &str) -> Option<&Parameter> {
        self.0.iter().find(|parameter| parameter.name == name)
    }

    fn value(&self, name: &str) -> ParameterValue {
        self.find(name)
            .map(|parameter| wire(&parameter.value))
            .unwrap_or_default()
    }

    fn list(&self, request: &ListParametersRequest) -> ListParametersResponse {
        let is_shallow = |rest: &str| {
            let levels = rest.split('.').count() as u64;
            request.depth == ListParametersRequest::DEPTH_RECURSIVE || levels <= request.depth
        };
        let below = |name: &str| {
            let prefixes = &request.prefixes;
            let mut rests = prefixes
                .iter()
                .filter_map(|prefix| below_prefix(name, prefix));
            (prefixes.is_empty() && is_shallow(name)) || rests.any(is_shallow)
        };
        let names: Vec<_> = self
            .0
            .iter()
            .map(|p| &p.name)
            .filter(|name| below(name))
            .cloned()
            .collect();
        let mut prefixes: Vec<_> = names
            .iter()
            .filter_map(|name| name.rsplit_once('.'))
            .map(|(prefix, _)| prefix.to_owned())
            .collect();
        prefixes.dedup();
        ListParametersResponse {
            result: ListParametersResult { names, prefixes },
        }
    }

    fn describe(&self, name: &str) -> ParameterDescriptor {
        let Some(parameter) = self.find(name) else {
            return ParameterDescriptor {
                name: name.to_owned(),
                ..Default::default()
            };
        };
        let mut descriptor = ParameterDescriptor {
            name: parameter.name.clone(),
            r#type: wire(&parameter.value).r#type,
            description: parameter.description.clone(),
            additional_constraints: FROZEN.to_owned(),
            read_only: true,
            ..Default::default()
        };
        match (&parameter.value, parameter.range) {
            (Value::Integer(_) | Value::IntegerArray(_), Some((from, to))) => {
                #[expect(clippy::cast_possible_truncation, reason = "limits of an integer")]
                let (from_value, to_value) = (from as i64, to as i64);
                let range = IntegerRange {
                    from_value,
                    to_value,
                    step: 0,
                };
                descriptor.integer_range.push(range);
            }
            (Value::Double(_) | Value::DoubleArray(_), Some((from_value, to_value))) => {
                let range = FloatingPointRange {
                    from_value,
                    to_value,
                    step: 0.0,
                };
                descriptor.floating_point_range.push(range);
            }
            _ => {}
        }
        descriptor
    }

    /// Why a parameter is not set: it is unknown, of another type, out of its range, or frozen.
    fn refuse(&self, wanted: &ParameterMessage) -> SetParametersResult {
        let name = &wanted.name;
        let reason = match self.find(name) {
            None => format!("parameter `{name}` is unknown"),
            Some(known) => {
                let (is, set) = (wire(&known.value).r#type, wanted.value.r#type);
                if is == set {
                    out_of_range(known, &wanted.value).unwrap_or_else(|| FROZEN.to_owned())
                } else {
                    format!(
                        "parameter `{name}` is {}, not {}",
                        type_name(is),
                        type_name(set)
                    )
                }
            }
        };
        SetParametersResult {
            successful: false,
            reason,
        }
    }
}

/// What is said of the first number that is outside a parameter's range.
fn out_of_range(parameter: &Parameter, wanted: &ParameterValue) -> Option<String> {
    let (from, to) = parameter.range?;
    let outside = |number: &f64| !(from..=to).contains(number);
    #[expect(
        clippy::cast_precision_loss,
        reason = "compared with limits that are doubles"
    )]
    let number = match &parameter.value {
        Value::Double(_) => Some(wanted.double_value).filter(outside),
        Value::DoubleArray(_) => wanted.double_array_value.iter().copied().find(outside),
        Value::Integer(_) => Some(wanted.integer_value as f64).filter(outside),
        Value::IntegerArray(_) => {
            let mut numbers = wanted.integer_array_value.iter().map(|n| *n as f64);
            numbers.find(outside)
        }
        _ => None,
    }?;
    let name = &parameter.name;
    Some(format!(
        "parameter `{name}`: {number} is outside {from} to {to}; and {FROZEN}"
    ))
}

/// What of a name is below a prefix; the name itself when it is the prefix.
fn below_prefix<'n>(name: &'n str, prefix: &str) -> Option<&'n str> {
    let rest = name.strip_prefix(prefix)?;
    if rest.is_empty() {
        Some(name)
    } else {
        rest.strip_prefix('.')
    }
}

const FROZEN: &str = "parameters are frozen after start: restart the node with the new value";

fn type_name(r#type: u8) -> &'static str {
    const NAMES: [&str; 10] = [
        "not set",
        "a bool",
        "an integer",
        "a double",
        "a string",
        "a byte array",
        "a bool array",
        "an integer array",
        "a double array",
        "a string array",
    ];
    NAMES
        .get(usize::from(r#type))
        .copied()
        .unwrap_or("of no type of ROS")
}

fn wire(value: &Value) -> ParameterValue {
    let mut wire = ParameterValue::default();
    wire.r#type = match value {
        Value::Bool(value) => {
            wire.bool_value = *value;
            ParameterType::PARAMETER_BOOL
        }
        Value::Integer(value) => {
            wire.integer_value = *value;
            ParameterType::PARAMETER_INTEGER
        }
        Value::Double(value) => {
            wire.double_value = *value;
            ParameterType::PARAMETER_DOUBLE
        }
        Value::String(value) => {
            wire.string_value.clone_from(value);
            ParameterType::PARAMETER_STRING
        }
        Value::BoolArray(values) => {
            wire.bool_array_value.clone_from(values);
            ParameterType::PARAMETER_BOOL_ARRAY
        }
        Value::IntegerArray(values) => {
            wire.integer_array_value.clone_from(values);
            ParameterType::PARAMETER_INTEGER_ARRAY
        }
        Value::DoubleArray(values) => {
            wire.double_array_value.clone_from(values);
            ParameterType::PARAMETER_DOUBLE_ARRAY
        }
        Value::StringArray(values) => {
            wire.string_array_value.clone_from(values);
            ParameterType::PARAMETER_STRING_ARRAY
        }
    };
    wire
}

/// What is told on `/parameter_events` when a node starts.
pub(super) fn start_event(node: &str, parameters: &[Parameter], at: Stamp<Host>) -> Bytes {
    let new_parameters = parameters
        .iter()
        .map(|p| ParameterMessage {
            name: p.name.clone(),
            value: wire(&p.value),
        })
        .collect();
    let event = ParameterEvent {
        stamp: clock::ros_time(at),
        node: node.to_owned(),
        new_parameters,
        ..Default::default()
    };
    shared(&to_cdr(&event))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters() -> Vec<Parameter> {
        let parameter = |name: &str, value, range| Parameter {
            name: name.to_owned(),
            value,
            description: "meaning".to_owned(),
            range,
        };
        vec![
            parameter("fade.seconds_s", Value::Double(2.0), Some((0.5, 10.0))),
            parameter("fade.steps", Value::Integer(3), Some((1.0, 9.0))),
            parameter("use_sim_time", Value::Bool(false), None),
        ]
    }

    #[test]
    fn a_request_of_endless_names_is_refused() {
        let names = vec![String::new(); MAX_REQUESTED_NAMES + 1];
        let requests = [
            (
                ParameterService::List,
                to_cdr(&ListParametersRequest {
                    prefixes: names.clone(),
                    depth: 0,
                }),
            ),
            (
                ParameterService::Get,
                to_cdr(&GetParametersRequest {
                    names: names.clone(),
                }),
            ),
            (
                ParameterService::Types,
                to_cdr(&GetParameterTypesRequest {
                    names: names.clone(),
                }),
            ),
            (
                ParameterService::Describe,
                to_cdr(&DescribeParametersRequest { names }),
            ),
            (
                ParameterService::Set,
                to_cdr(&SetParametersRequest {
                    parameters: vec![ParameterMessage::default(); MAX_REQUESTED_NAMES + 1],
                }),
            ),
        ];
        for (service, request) in requests {
            let refused = service.answer(&parameters(), &request).unwrap_err();
            let said = refused.to_string();
            assert!(said.contains("10001 entries: at most 10000"), "{said}");
        }
    }

    fn list(prefixes: &[&str], depth: u64) -> Vec<String> {
        let prefixes = prefixes.iter().map(|p| (*p).to_owned()).collect();
        let request = to_cdr(&ListParametersRequest { prefixes, depth });
        let answer = ParameterService::List
            .answer(&parameters(), &request)
            .unwrap();
        from_cdr::<ListParametersResponse>(&answer)
            .unwrap()
            .result
            .names
    }

    #[test]
    fn lists_follow_prefix_and_depth() {
        assert_eq!(list(&[], 0).len(), 3);
        assert_eq!(list(&[], 1), ["use_sim_time"]);
        assert_eq!(list(&["fade"], 0), ["fade.seconds_s", "fade.steps"]);
        assert_eq!(list(&["fad"], 0), [""; 0]);
    }

    #[test]
    fn setting_is_refused_with_the_reason_that_fits() {
        let refuse = |name: &str, value: Value| {
            let set = ParameterMessage {
                name: name.to_owned(),
                value: wire(&value),
            };
            Table(&parameters()).refuse(&set).reason
        };
        assert_eq!(refuse("fade.seconds_s", Value::Double(3.0)), FROZEN);
        assert_eq!(
            refuse("fade.seconds_s", Value::Integer(3)),
            "parameter `fade.seconds_s` is a double, not an integer"
        );
        for (wrong, shown) in [(11.0, "11"), (0.4, "0.4"), (f64::NAN, "NaN")] {
            assert_eq!(
                refuse("fade.seconds_s", Value::Double(wrong)),
                format!("parameter `fade.seconds_s`: {shown} is outside 0.5 to 10; and {FROZEN}")
            );
        }
        assert!(refuse("fade.steps", Value::Integer(10)).contains("10 is outside 1 to 9"));
        assert_eq!(
            refuse("fad", Value::Integer(3)),
            "parameter `fad` is unknown"
        );
    }

    #[test]
    fn descriptions_carry_type_and_range() {
        let names = vec![
            "fade.seconds_s".to_owned(),
            "fade.steps".to_owned(),
            "x".to_owned(),
        ];
        let request = to_cdr(&DescribeParametersRequest { names });
        let answer = ParameterService::Describe
            .answer(&parameters(), &request)
            .unwrap();
        let described = from_cdr::<DescribeParametersResponse>(&answer)
            .unwrap()
            .descriptors;
        assert!((described[0].floating_point_range[0].to_value - 10.0).abs() < 1e-12);
        assert_eq!(described[1].integer_range[0].from_value, 1);
        assert!(described[0].read_only);
        assert_eq!(described[2].r#type, ParameterType::PARAMETER_NOT_SET);
    }
}
