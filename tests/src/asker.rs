//! Somebody on the graph who calls services from a test's own thread, with requests of any bytes, and asks again when
//! nobody answers in time.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use abbe_msgs::{Service, from_cdr, to_cdr};
use metrology::stamp::{Host, Span, Stamp};
use node_runtime::arguments::Arguments;
use node_runtime::environment::Environment;
use node_runtime::node::{Ports, RequestId, ServiceEvents, ServicePort};
use node_runtime::parameter::Parameter;
use node_runtime::{Emission, Event, Node, NodeFault, Running, Setup, launch};

/// How long an answer may take on a busy computer.
const PATIENCE: Duration = Duration::from_secs(60);

/// A service as a port of who calls it.
#[must_use]
pub fn service<V: Service>(name: &str) -> ServicePort {
    ServicePort {
        service: name.to_owned(),
        type_name: V::TYPE_NAME,
        events: ServiceEvents::of::<V>(),
    }
}

#[derive(Default)]
struct Post {
    next_id: RequestId,
    /// Service, number and bytes of requests that are to be sent.
    requests: Vec<(usize, RequestId, Vec<u8>)>,
    /// What was sent, without an answer yet.
    open: BTreeMap<RequestId, (usize, Vec<u8>)>,
    answers: BTreeMap<RequestId, Vec<u8>>,
}

struct Clerk {
    ports: Ports,
    post: Arc<Mutex<Post>>,
}

impl Node for Clerk {
    fn name(&self) -> &str {
        "asker"
    }

    fn ports(&self) -> &Ports {
        &self.ports
    }

    fn parameters(&self) -> &[Parameter] {
        &[]
    }

    fn handle(
        &mut self,
        _at: Stamp<Host>,
        event: Event<'_>,
        out: &mut Vec<Emission>,
    ) -> Result<(), NodeFault> {
        let mut post = self.post.lock().unwrap();
        match event {
            Event::Timer { .. } => {
                for (client, id, bytes) in std::mem::take(&mut post.requests) {
                    post.open.insert(id, (client, bytes.clone()));
                    let bytes = bytes.into();
                    out.push(Emission::Call { client, id, bytes });
                }
            }
            Event::Response { id, bytes, .. } => {
                let asked = post.open.remove(&id);
                match (bytes, asked) {
                    (Some(bytes), _) => {
                        post.answers.insert(id, bytes.to_vec());
                    }
                    // Given up: a busy computer was too slow, or there was no server yet.
                    (None, Some((client, bytes))) => post.requests.push((client, id, bytes)),
                    (None, None) => {}
                }
            }
            Event::Shutdown => out.push(Emission::Stopped),
            _ => {}
        }
        Ok(())
    }
}

/// Calls the services with which it was made, by their places.
pub struct Asker {
    running: Running,
    post: Arc<Mutex<Post>>,
}

impl Asker {
    /// Joins the network as a node that only asks.
    ///
    /// # Panics
    /// When there is no network.
    #[must_use]
    pub fn join(environment: &Environment, services: Vec<ServicePort>) -> Self {
        let post = Arc::<Mutex<Post>>::default();
        let clerk = Clerk {
            ports: Ports {
                clients: services,
                timers: vec![Span::from_nanos(5_000_000)],
                ..Ports::default()
            },
            post: Arc::clone(&post),
        };
        let setup = Setup::new("asker", &Arguments::default()).unwrap();
        let running = launch(environment, vec![(setup, Box::new(clerk))]).unwrap();
        Self { running, post }
    }

    /// Sends a request of these bytes; its number.
    ///
    /// # Panics
    /// When its thread has panicked.
    #[must_use]
    pub fn send(&self, place: usize, bytes: &[u8]) -> RequestId {
        let mut post = self.post.lock().unwrap();
        post.next_id += 1;
        let id = post.next_id;
        post.requests.push((place, id, bytes.to_vec()));
        id
    }

    /// The answer to a request, where it has come.
    ///
    /// # Panics
    /// When its bytes are no answer of `V`.
    #[must_use]
    pub fn answer<V: Service>(&self, id: RequestId) -> Option<V::Response> {
        let post = self.post.lock().unwrap();
        let bytes = post.answers.get(&id)?;
        Some(from_cdr(bytes).unwrap())
    }

    /// Asks and waits for the answer.
    ///
    /// # Panics
    /// When it does not come within 60 s.
    #[must_use]
    pub fn ask<V: Service>(&self, place: usize, request: &V::Request) -> V::Response {
        self.wait::<V>(self.send(place, &to_cdr(request)))
    }

    /// Waits for the answer to a request.
    ///
    /// # Panics
    /// When it does not come within 60 s.
    #[must_use]
    pub fn wait<V: Service>(&self, id: RequestId) -> V::Response {
        let deadline = Instant::now() + PATIENCE;
        loop {
            if let Some(answer) = self.answer::<V>(id) {
                return answer;
            }
            let type_name = V::TYPE_NAME;
            assert!(Instant::now() < deadline, "{type_name}: no answer");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Leaves.
    ///
    /// # Panics
    /// When its thread panicked.
    pub fn stop(self) {
        self.running.stop().unwrap();
    }
}
