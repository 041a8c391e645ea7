//! Looks through a server for a mapping to propose.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use machine_report::MapFile;
use opcua::client::{IdentityToken, Session};
use opcua::types::{
    EUInformation, NodeClass, NodeId, ObjectId, ReadValueId, TimestampsToReturn, Variant,
};
use tokio::time::{Instant, timeout_at};

use super::client::Clients;
use super::convert::{self, identifier};
use super::nodes::{children, namespaces};
use super::{Credentials, endpoint};
use crate::config::{BridgeConfig, ConnectionConfig, SecurityConfig, Settings, SubscriptionConfig};
use crate::error::BridgeError;
use crate::node_key::{NodeKey, STEPS_LIMIT};
use crate::proposal::{Survey, Variable};
use crate::stage::IoEvent;

/// The whole search takes at most this time.
const LIMIT: Duration = Duration::from_secs(10);
/// Of that time so much is left for the units of what was found.
const FOR_UNITS: Duration = Duration::from_secs(2);
/// Nodes that are looked at, at most.
const NODES: usize = 20_000;
/// Units in one request at most.
const UNITS_CHUNK: usize = 100;

/// A node whose children are to be looked at.
struct Open {
    node: NodeId,
    path: Vec<String>,
    /// Which variable it is.
    variable: Option<usize>,
}

/// Browses the server at `url` from `Objects` on, unsecured and anonymous, for at most 10 s and 20,000 nodes.
///
/// # Errors
/// When nobody answers, or the server does not let us in.
pub fn survey(url: &str) -> Result<Survey, BridgeError> {
    let config = BridgeConfig {
        endpoint: url.to_owned(),
        map_file: String::new(),
        security: SecurityConfig::default(),
        subscription: SubscriptionConfig::default(),
        connection: ConnectionConfig::default(),
    };
    let settings = Settings::new(&config, &MapFile::default())?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|source| BridgeError::Io {
            action: "starting the event loop",
            source,
        })?;
    let surveyed = runtime.block_on(asked(&settings));
    runtime.shutdown_timeout(Duration::from_millis(500));
    surveyed
}

async fn asked(settings: &Settings) -> Result<Survey, BridgeError> {
    let failed = |reason: String| BridgeError::Ask {
        endpoint: settings.endpoint.clone(),
        reason,
    };
    let deadline = Instant::now() + LIMIT;
    let clients = Clients::new(settings, &Credentials::default())?;
    let late = || {
        failed(
            "no answer within 10 s: is it an OPC UA server, and the port its own (4840 for most)?"
                .to_owned(),
        )
    };
    let chosen = timeout_at(deadline, endpoint::choose(&clients.discovery, settings)).await;
    let endpoint = match chosen.map_err(|_| late())? {
        Ok(endpoint) => endpoint,
        Err(IoEvent::Refused { reason } | IoEvent::Ended { reason }) => return Err(failed(reason)),
        Err(other) => return Err(failed(format!("{other:?}"))),
    };
    let built = clients
        .discovery
        .session_builder()
        .user_identity_token(IdentityToken::Anonymous)
        .connect_to_endpoint_directly(endpoint)
        .and_then(|builder| {
            builder.build(std::sync::Arc::clone(clients.discovery.certificate_store()))
        });
    let (session, event_loop) = built.map_err(|error| failed(convert::reason(&error)))?;
    let pump = event_loop.spawn();
    let made = timeout_at(deadline, session.wait_for_connection()).await;
    if !made.map_err(|_| late())? {
        pump.abort();
        return Err(failed("the session could not be made".to_owned()));
    }
    let mut search = Search::default();
    let searched = timeout_at(deadline, search.run(&session, deadline - FOR_UNITS)).await;
    let mut survey = search.survey;
    match searched {
        Ok(Ok(())) => {}
        Ok(Err(error)) => survey.stopped = Some(error.to_string()),
        Err(_) => survey.stopped = Some("10 s have passed".to_owned()),
    }
    // The server ends a session that is not closed.
    let _ = tokio::time::timeout(Duration::from_secs(1), session.disconnect()).await;
    pump.abort();
    Ok(survey)
}

/// A search in progress: what was found stays when its time is over.
#[derive(Default)]
struct Search {
    survey: Survey,
    open: VecDeque<Open>,
    seen: BTreeSet<String>,
    /// Variable and the node that holds its unit.
    units: Vec<(usize, NodeId)>,
}

impl Search {
    async fn run(&mut self, session: &Session, until: Instant) -> Result<(), opcua::types::Error> {
        let namespaces = namespaces(session).await?;
        self.open.push_back(Open {
            node: ObjectId::ObjectsFolder.into(),
            path: Vec::new(),
            variable: None,
        });
        // The server's account of itself is no machine.
        self.seen.insert(NodeId::from(ObjectId::Server).to_string());
        while let Some(open) = self.open.pop_front() {
            self.look(session, &namespaces, open).await?;
            if self.survey.nodes >= NODES {
                self.survey.stopped = Some(format!("{NODES} nodes were looked at"));
                break;
            }
            if Instant::now() >= until && !self.open.is_empty() {
                let n = self.survey.nodes;
                self.survey.stopped = Some(format!("after {n} nodes its time was over"));
                break;
            }
        }
        self.read_units(session).await
    }

    async fn look(
        &mut self,
        session: &Session,
        namespaces: &[String],
        open: Open,
    ) -> Result<(), opcua::types::Error> {
        for child in children(session, &open.node).await? {
            if self.survey.nodes >= NODES {
                break;
            }
            let node = child.node_id.node_id;
            let name = child.browse_name.name.as_ref().to_owned();
            if let (Some(variable), "EngineeringUnits") = (open.variable, name.as_str()) {
                self.units.push((variable, node));
                continue;
            }
            if !self.seen.insert(node.to_string()) {
                continue;
            }
            self.survey.nodes += 1;
            let mut path = open.path.clone();
            path.push(name);
            let uri = |index: u16| namespaces.get(usize::from(index)).cloned();
            let namespace = match node.namespace {
                0 => Some(String::new()),
                index => uri(index).filter(|uri| !uri.is_empty()),
            };
            let is_variable = child.node_class == NodeClass::Variable;
            let mut variable = None;
            if let Some(namespace) = namespace.filter(|_| is_variable) {
                variable = Some(self.survey.variables.len());
                self.survey.variables.push(Variable {
                    node: NodeKey::Id {
                        namespace,
                        identifier: identifier(&node),
                    },
                    path: path.clone(),
                    namespace: uri(child.browse_name.namespace_index).unwrap_or_default(),
                    unit: String::new(),
                });
            }
            if path.len() < STEPS_LIMIT {
                self.open.push_back(Open {
                    node,
                    path,
                    variable,
                });
            }
        }
        Ok(())
    }

    async fn read_units(&mut self, session: &Session) -> Result<(), opcua::types::Error> {
        for chunk in self.units.chunks(UNITS_CHUNK) {
            let asked: Vec<ReadValueId> = chunk
                .iter()
                .map(|(_, node)| ReadValueId::from(node.clone()))
                .collect();
            let read = session.read(&asked, TimestampsToReturn::Neither, 0.0);
            for ((variable, _), value) in chunk.iter().zip(read.await?) {
                let Some(Variant::ExtensionObject(object)) = value.value else {
                    continue;
                };
                let shown = object.inner_as::<EUInformation>();
                let shown = shown.map(|unit| unit.display_name.text.as_ref().to_owned());
                if let (Some(shown), Some(found)) =
                    (shown, self.survey.variables.get_mut(*variable))
                {
                    found.unit = shown;
                }
            }
        }
        Ok(())
    }
}
