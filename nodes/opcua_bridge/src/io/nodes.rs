//! Which nodes of a server the keys of a mapping are today.

use opcua::client::Session;
use opcua::types::{
    BrowseDescription, BrowseDirection, EUInformation, Error, NodeClass, NodeId, ObjectId,
    ReadValueId, ReferenceDescription, ReferenceTypeId, StatusCode, TimestampsToReturn, VariableId,
    Variant,
};

use super::convert::node_id;
use crate::config::Item;
use crate::engineering_unit::ShownUnit;
use crate::node_key::{NodeKey, Step};

/// Namespaces of a server at most.
const NAMESPACES: usize = 4096;
/// References of a node that are looked at, at most.
pub(super) const REFERENCES: usize = 10_000;
/// Nodes that a path may lead to on its way, at most.
const BRANCHES: usize = 256;

/// The nodes of the items.
pub(super) struct Found {
    /// Item and node.
    pub nodes: Vec<(usize, NodeId)>,
    /// Item, and why it has no node.
    pub missing: Vec<(usize, String)>,
}

/// The namespaces of a server, by index.
pub(super) async fn namespaces(session: &Session) -> Result<Vec<String>, Error> {
    let node: NodeId = VariableId::Server_NamespaceArray.into();
    let asked = [ReadValueId::from(node)];
    let read = session.read(&asked, TimestampsToReturn::Neither, 0.0);
    let value = read.await?.into_iter().next().and_then(|read| read.value);
    let Some(Variant::Array(array)) = value else {
        let reason = "the server gives no list of its namespaces";
        return Err(Error::new(StatusCode::BadNoValue, reason));
    };
    let uri = |value: Variant| match value {
        Variant::String(uri) => uri.value().clone().unwrap_or_default(),
        _ => String::new(),
    };
    Ok(array.values.into_iter().take(NAMESPACES).map(uri).collect())
}

/// Looks up every item.
pub(super) async fn find(session: &Session, items: &[Item]) -> Result<Found, Error> {
    let namespaces = namespaces(session).await?;
    let mut found = Found {
        nodes: Vec::new(),
        missing: Vec::new(),
    };
    for (at, item) in items.iter().enumerate() {
        let node = match &item.node {
            NodeKey::Id {
                namespace,
                identifier,
            } => match item.node.index(&namespaces) {
                Some(index) => node_id(index, identifier)
                    .ok_or_else(|| "an identifier that cannot be sent".to_owned()),
                None => Err(format!("no namespace {namespace}")),
            },
            NodeKey::Path(steps) => follow(session, &namespaces, steps).await?,
        };
        match node {
            Ok(node) => found.nodes.push((at, node)),
            Err(reason) => found.missing.push((at, reason)),
        }
    }
    Ok(found)
}

/// Follows a path from `Objects` on; exactly one node must be at its end.
async fn follow(
    session: &Session,
    namespaces: &[String],
    steps: &[Step],
) -> Result<Result<NodeId, String>, Error> {
    let mut here: Vec<NodeId> = vec![ObjectId::ObjectsFolder.into()];
    for (at, step) in steps.iter().enumerate() {
        let mut next: Vec<NodeId> = Vec::new();
        for node in &here {
            for child in children(session, node).await? {
                let index = usize::from(child.browse_name.namespace_index);
                let namespace = namespaces.get(index).map_or("", String::as_str);
                let child_id = child.node_id.node_id;
                let is_one = step.holds(namespace, child.browse_name.name.as_ref());
                if is_one && !next.contains(&child_id) {
                    next.push(child_id);
                }
            }
            if next.len() > BRANCHES {
                return Ok(Err(format!(
                    "more than {BRANCHES} nodes at step {}",
                    at + 1
                )));
            }
        }
        if next.is_empty() {
            let name = step.name.as_deref().unwrap_or("*");
            return Ok(Err(format!("no {name} at step {}", at + 1)));
        }
        here = next;
    }
    Ok(match here.as_slice() {
        [node] => Ok(node.clone()),
        nodes => Err(format!(
            "{} nodes: write the name in place of *",
            nodes.len()
        )),
    })
}

/// Objects and variables below a node, up to [`REFERENCES`].
pub(super) async fn children(
    session: &Session,
    node: &NodeId,
) -> Result<Vec<ReferenceDescription>, Error> {
    let asked = BrowseDescription {
        node_id: node.clone(),
        browse_direction: BrowseDirection::Forward,
        reference_type_id: ReferenceTypeId::HierarchicalReferences.into(),
        include_subtypes: true,
        node_class_mask: NodeClass::Object as u32 | NodeClass::Variable as u32,
        result_mask: 0x3F,
    };
    let mut all: Vec<ReferenceDescription> = Vec::new();
    let mut results = session.browse(&[asked], 1000, None).await?;
    while let Some(result) = results.pop() {
        if result.status_code.is_bad() {
            // A node that may not be browsed has no children for us.
            break;
        }
        all.extend(result.references.into_iter().flatten());
        let point = result.continuation_point;
        if point.is_null_or_empty() {
            break;
        }
        let is_over = all.len() >= REFERENCES;
        results = session.browse_next(is_over, &[point]).await?;
        if is_over {
            break;
        }
    }
    all.truncate(REFERENCES);
    Ok(all)
}

/// Nodes in one request for units at most.
const UNITS_CHUNK: usize = 100;

/// The `EngineeringUnits` of nodes that have any.
pub(super) async fn units(
    session: &Session,
    nodes: &[(usize, NodeId)],
) -> Result<Vec<(usize, ShownUnit)>, Error> {
    let mut units = Vec::new();
    for chunk in nodes.chunks(UNITS_CHUNK) {
        let asked: Vec<_> = chunk.iter().map(|(_, node)| properties_of(node)).collect();
        let found = session.browse(&asked, 100, None).await?;
        let mut holders = Vec::new();
        for ((item, _), result) in chunk.iter().zip(found) {
            let of_unit = |property: &ReferenceDescription| {
                let name: &str = property.browse_name.name.as_ref();
                name == "EngineeringUnits"
            };
            let mut properties = result.references.into_iter().flatten();
            if let Some(property) = properties.find(of_unit) {
                holders.push((*item, property.node_id.node_id));
            }
        }
        let asked: Vec<ReadValueId> = holders
            .iter()
            .map(|(_, node)| ReadValueId::from(node.clone()))
            .collect();
        if asked.is_empty() {
            continue;
        }
        let read = session.read(&asked, TimestampsToReturn::Neither, 0.0);
        for ((item, _), value) in holders.iter().zip(read.await?) {
            let Some(Variant::ExtensionObject(object)) = value.value else {
                continue;
            };
            if let Some(unit) = object.inner_as::<EUInformation>() {
                let text = unit.display_name.text.as_ref().to_owned();
                let code = unit.unit_id;
                units.push((*item, ShownUnit { text, code }));
            }
        }
    }
    Ok(units)
}

fn properties_of(node: &NodeId) -> BrowseDescription {
    BrowseDescription {
        node_id: node.clone(),
        browse_direction: BrowseDirection::Forward,
        reference_type_id: ReferenceTypeId::HasProperty.into(),
        include_subtypes: true,
        node_class_mask: NodeClass::Variable as u32,
        result_mask: 0x3F,
    }
}
