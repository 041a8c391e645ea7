//! Every message, service and action by its ROS 2 name, with the types that ROS 2 makes of them.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, bail};
use ros2msg::msg::{
    AnnotationValue, Annotations, Field, MessageSpecification, Type, create_feedback_message,
    create_service_event_message,
};
use ros2msg::{parse_action_string, parse_message_string, parse_service_string};

/// A message: one of a `.msg` file, a part of a service or action, or one that ROS 2 derives.
pub struct Message {
    /// `package/kind/Name`.
    pub full_name: String,
    /// Fields and constants.
    pub spec: MessageSpecification,
    /// Its text as written, comments included; `None`: ROS 2 derives it, no Rust type is made of it.
    pub text: Option<String>,
}

/// A service or action by the names of its parts.
pub struct Compound {
    /// `package/kind/Name`.
    pub full_name: String,
    /// Text above the first part, for documentation.
    pub comment: Vec<String>,
}

/// All interfaces, sorted by full name.
#[derive(Default)]
pub struct Interfaces {
    /// Messages, those derived from services and actions included.
    pub messages: BTreeMap<String, Message>,
    /// Services, without those of actions.
    pub services: Vec<Compound>,
    /// Actions.
    pub actions: Vec<Compound>,
    /// Files by the full name of what they define: their kind and their text.
    pub sources: BTreeMap<String, (&'static str, String)>,
}

impl Interfaces {
    /// Adds a `.msg` file.
    pub fn add_message_file(&mut self, package: &str, name: &str, text: &str) -> Result<()> {
        let spec = parse_message_string(package, name, text)?;
        self.add("msg", spec, Some(text.to_owned()));
        self.add_source(package, "msg", name, text);
        Ok(())
    }

    /// Adds a `.srv` file with its request and response.
    pub fn add_service_file(&mut self, package: &str, name: &str, text: &str) -> Result<()> {
        let parsed = parse_service_string(package, name, text)?;
        let comment = comment_lines(&parsed.request.annotations);
        let parts = split_parts(text);
        let event = create_service_event_message(package, name, &parsed.request, &parsed.response)?;
        for (spec, part) in [parsed.request, parsed.response].into_iter().zip(parts) {
            self.add("srv", spec, Some(part));
        }
        self.add("srv", event, None);
        self.add_service_of(package, "srv", name)?;
        self.add_source(package, "srv", name, text);
        self.services.push(Compound {
            full_name: format!("{package}/srv/{name}"),
            comment,
        });
        Ok(())
    }

    /// Adds an `.action` file with its goal, result, feedback and what ROS 2 derives from them.
    pub fn add_action_file(&mut self, package: &str, name: &str, text: &str) -> Result<()> {
        let parsed = parse_action_string(package, name, text)?;
        let comment = comment_lines(&parsed.goal.annotations);
        let feedback_message = create_feedback_message(package, name, &parsed.feedback)?;
        let parts = [parsed.goal, parsed.result, parsed.feedback];
        for (spec, part) in parts.into_iter().zip(split_parts(text)) {
            self.add("action", spec, Some(part));
        }
        for service in [parsed.goal_service, parsed.result_service] {
            let service_name = service.srv_name;
            let (request, response) = (service.request, service.response);
            let event = create_service_event_message(package, &service_name, &request, &response)?;
            for spec in [request, response, event] {
                self.add("action", spec, None);
            }
            self.add_service_of(package, "action", &service_name)?;
        }
        self.add("action", feedback_message, None);
        let fields = [
            ("goal", "_Goal"),
            ("result", "_Result"),
            ("feedback", "_Feedback"),
            ("send_goal_service", "_SendGoal"),
            ("get_result_service", "_GetResult"),
            ("feedback_message", "_FeedbackMessage"),
        ];
        self.add_whole(package, "action", name, &fields)?;
        self.add_source(package, "action", name, text);
        self.actions.push(Compound {
            full_name: format!("{package}/action/{name}"),
            comment,
        });
        Ok(())
    }

    /// Refuses a field whose type is not among the interfaces or that the wire cannot carry yet.
    pub fn check_references(&self) -> Result<()> {
        for message in self.messages.values() {
            for field in &message.spec.fields {
                let base = &field.field_type.base_type;
                let place = format!("{}: field {}", message.full_name, field.name);
                match self.nested(message, field) {
                    Some(name) if !self.messages.contains_key(&name) => {
                        bail!("{place}: there is no {name}")
                    }
                    None if ["wstring", "time", "duration"].contains(&base.type_name.as_str()) => {
                        bail!("{place}: {} has no form on this wire", base.type_name)
                    }
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// Refuses other definitions of what is no message by itself: each type that holds it would have another hash too.
    pub fn check_unreferenced(&self, changed: &BTreeSet<String>) -> Result<()> {
        for message in self.messages.values() {
            let mut held = message.spec.fields.iter();
            let held = held.find_map(|field| {
                let name = self.nested(message, field)?;
                changed.contains(&name).then_some(name)
            });
            if let Some(name) = held {
                bail!(
                    "{} holds {name}, which has two definitions",
                    message.full_name
                );
            }
        }
        let other = changed.iter().find(|name| !name.contains("/msg/"));
        other.map_or(Ok(()), |name| {
            bail!("{name}: two definitions of a message alone")
        })
    }

    /// Full name of the message that `field` of `owner` holds; `None`: a primitive.
    ///
    /// A name without kind means a message of a `.msg` file, except for the parts of services and
    /// actions, which only what ROS 2 derives from these can name.
    pub fn nested(&self, owner: &Message, field: &Field) -> Option<String> {
        let base = &field.field_type.base_type;
        let package = base.pkg_name.as_ref()?;
        let kind = owner.full_name.split('/').nth(1).unwrap_or("msg");
        let beside = format!("{package}/{kind}/{}", base.type_name);
        if owner.text.is_none() && self.messages.contains_key(&beside) {
            return Some(beside);
        }
        Some(format!("{package}/msg/{}", base.type_name))
    }

    /// The description of a whole service: its request, response and event.
    fn add_service_of(&mut self, package: &str, kind: &str, name: &str) -> Result<()> {
        let fields = [
            ("request_message", "_Request"),
            ("response_message", "_Response"),
            ("event_message", "_Event"),
        ];
        self.add_whole(package, kind, name, &fields)
    }

    fn add_source(&mut self, package: &str, kind: &'static str, name: &str, text: &str) {
        let full_name = format!("{package}/{kind}/{name}");
        self.sources.insert(full_name, (kind, text.to_owned()));
    }

    fn add_whole(
        &mut self,
        package: &str,
        kind: &str,
        name: &str,
        fields: &[(&str, &str)],
    ) -> Result<()> {
        let mut whole = MessageSpecification::new(package.to_owned(), name.to_owned())?;
        for (field, suffix) in fields {
            let part = Type::new(&format!("{package}/{name}{suffix}"), None)?;
            whole.add_field(Field::new(part, field, None)?);
        }
        self.add(kind, whole, None);
        Ok(())
    }

    fn add(&mut self, kind: &str, spec: MessageSpecification, text: Option<String>) {
        let full_name = format!("{}/{kind}/{}", spec.pkg_name, spec.msg_name);
        let message = Message {
            full_name: full_name.clone(),
            spec,
            text,
        };
        self.messages.insert(full_name, message);
    }
}

/// The comment above a message, field or constant, without its unit.
pub fn comment_lines(annotations: &Annotations) -> Vec<String> {
    match annotations.get("comment") {
        Some(AnnotationValue::StringList(lines)) => lines.clone(),
        _ => Vec::new(),
    }
}

/// The unit in square brackets, where there is just one.
pub fn unit(annotations: &Annotations) -> Option<&str> {
    match annotations.get("unit") {
        Some(AnnotationValue::String(unit)) => Some(unit),
        _ => None,
    }
}

/// The texts between the `---` lines.
fn split_parts(text: &str) -> Vec<String> {
    let mut parts = vec![String::new()];
    for line in text.lines() {
        if line.trim() == "---" {
            parts.push(String::new());
        } else if let Some(part) = parts.last_mut() {
            part.push_str(line);
            part.push('\n');
        }
    }
    parts
}
