//! The service that describes the types of a node, as every node of Jazzy has it.
//!
//! Who meets a type that it does not know asks one of the nodes that use it, by name and hash.

use abbe_msgs::type_description_interfaces::msg::{
    Field, FieldType, IndividualTypeDescription, TypeDescription, TypeSource,
};
use abbe_msgs::type_description_interfaces::srv::{
    GetTypeDescription, GetTypeDescriptionRequest, GetTypeDescriptionResponse,
};
use abbe_msgs::{Release, Service, TypeParts, WireError, from_cdr, to_cdr};

use super::service::shared;
use crate::node::Bytes;

/// The service's name below the node and its type.
pub(super) const TYPE_SERVICE: (&str, &str) =
    ("~/get_type_description", GetTypeDescription::TYPE_NAME);

/// The answer to a request, by the definitions of a release.
///
/// # Errors
/// When the request is malformed.
pub(super) fn answer(release: Release, bytes: &[u8]) -> Result<Bytes, WireError> {
    let request: GetTypeDescriptionRequest = from_cdr(bytes)?;
    let response = match found(release, &request) {
        Ok(parts) => described(release, parts, request.include_type_sources),
        Err(failure_reason) => GetTypeDescriptionResponse {
            failure_reason,
            ..Default::default()
        },
    };
    Ok(shared(&to_cdr(&response)))
}

fn found(
    release: Release,
    request: &GetTypeDescriptionRequest,
) -> Result<&'static TypeParts, String> {
    let GetTypeDescriptionRequest {
        type_name,
        type_hash,
        ..
    } = request;
    let parts = release
        .parts_of(type_name)
        .ok_or_else(|| format!("type `{type_name}` is not known here"))?;
    // An empty hash asks for the type by its name alone.
    if type_hash.is_empty() || type_hash == parts.type_hash {
        Ok(parts)
    } else {
        Err(format!(
            "type `{type_name}` has the hash {} here, not {type_hash}",
            parts.type_hash
        ))
    }
}

fn described(
    release: Release,
    parts: &TypeParts,
    with_sources: bool,
) -> GetTypeDescriptionResponse {
    let referenced: Vec<_> = parts
        .referenced
        .iter()
        .filter_map(|name| release.parts_of(name))
        .collect();
    let type_description = TypeDescription {
        type_description: individual(parts),
        referenced_type_descriptions: referenced.iter().map(|other| individual(other)).collect(),
    };
    let sources = std::iter::once(parts).chain(referenced).map(source);
    GetTypeDescriptionResponse {
        successful: true,
        type_description,
        type_sources: if with_sources {
            sources.collect()
        } else {
            Vec::new()
        },
        ..Default::default()
    }
}

fn individual(parts: &TypeParts) -> IndividualTypeDescription {
    let fields = parts.fields.iter().map(|field| Field {
        name: field.name.to_owned(),
        r#type: FieldType {
            type_id: field.type_id,
            capacity: field.capacity,
            string_capacity: field.string_capacity,
            nested_type_name: field.nested.to_owned(),
        },
        default_value: field.default.to_owned(),
    });
    IndividualTypeDescription {
        type_name: parts.type_name.to_owned(),
        fields: fields.collect(),
    }
}

fn source(parts: &TypeParts) -> TypeSource {
    let (encoding, text) = parts.source;
    TypeSource {
        type_name: parts.type_name.to_owned(),
        encoding: encoding.to_owned(),
        raw_file_contents: text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use abbe_msgs::msg::AxisState;
    use abbe_msgs::{Message, Service as _};

    use super::*;

    fn asked(type_name: &str, type_hash: &str, sources: bool) -> GetTypeDescriptionResponse {
        let request = to_cdr(&GetTypeDescriptionRequest {
            type_name: type_name.to_owned(),
            type_hash: type_hash.to_owned(),
            include_type_sources: sources,
        });
        from_cdr(&answer(Release::Jazzy, &request).unwrap()).unwrap()
    }

    #[test]
    fn a_message_of_two_definitions_is_described_by_that_of_the_graph() {
        for (release, field) in [(Release::Jazzy, "timestamp"), (Release::Lyrical, "stamp")] {
            let type_name = "lifecycle_msgs/msg/TransitionEvent".to_owned();
            let own = release.parts_of(&type_name).unwrap();
            let request = to_cdr(&GetTypeDescriptionRequest {
                type_name,
                type_hash: own.type_hash.to_owned(),
                include_type_sources: true,
            });
            let bytes = answer(release, &request).unwrap();
            let response: GetTypeDescriptionResponse = from_cdr(&bytes).unwrap();
            assert!(response.successful, "{}", response.failure_reason);
            let fields = &response.type_description.type_description.fields;
            assert_eq!(fields[0].name, field);
            assert!(response.type_sources[0].raw_file_contents.contains(field));
        }
    }

    #[test]
    fn a_message_comes_with_all_that_it_refers_to_and_its_file() {
        let response = asked(AxisState::TYPE_NAME, AxisState::TYPE_HASH, true);
        assert!(response.successful, "{}", response.failure_reason);
        let TypeDescription {
            type_description,
            referenced_type_descriptions,
        } = response.type_description;
        assert_eq!(type_description.type_name, AxisState::TYPE_NAME);
        assert_eq!(type_description.fields[0].name, "header");
        let nested = &type_description.fields[0].r#type.nested_type_name;
        assert_eq!(nested, "std_msgs/msg/Header");
        let names: Vec<_> = referenced_type_descriptions
            .iter()
            .map(|other| other.type_name.as_str())
            .collect();
        assert_eq!(
            names,
            ["builtin_interfaces/msg/Time", "std_msgs/msg/Header"]
        );
        let sources = response.type_sources;
        assert_eq!(sources.len(), 3);
        assert_eq!(sources[0].encoding, "msg");
        assert!(AxisState::DEFINITION.starts_with(&sources[0].raw_file_contents));
        assert!(
            asked(AxisState::TYPE_NAME, "", false)
                .type_sources
                .is_empty()
        );
    }

    #[test]
    fn a_service_has_the_text_of_its_file_and_its_parts_none() {
        let response = asked(GetTypeDescription::TYPE_NAME, "", true);
        let fields = response.type_description.type_description.fields;
        let names: Vec<_> = fields.iter().map(|field| field.name.as_str()).collect();
        assert_eq!(
            names,
            ["request_message", "response_message", "event_message"]
        );
        let source = |name: &str| {
            let mut sources = response.type_sources.iter();
            sources.find(|source| source.type_name == name).unwrap()
        };
        let whole = source(GetTypeDescription::TYPE_NAME);
        assert!(whole.raw_file_contents.contains("\n---\n"));
        assert_eq!(whole.encoding, "srv");
        let part = source(&format!("{}_Request", GetTypeDescription::TYPE_NAME));
        assert_eq!(
            (part.encoding.as_str(), part.raw_file_contents.as_str()),
            ("implicit", "")
        );
    }

    #[test]
    fn unknown_names_and_other_hashes_are_refused_with_the_reason() {
        let response = asked("abbe_msgs/msg/Nobody", "", true);
        assert!(!response.successful);
        assert_eq!(
            response.failure_reason,
            "type `abbe_msgs/msg/Nobody` is not known here"
        );
        let response = asked(AxisState::TYPE_NAME, "RIHS01_00", true);
        assert!(!response.successful);
        let reason = response.failure_reason;
        assert!(
            reason.contains(AxisState::TYPE_HASH) && reason.contains("RIHS01_00"),
            "{reason}"
        );
    }
}
