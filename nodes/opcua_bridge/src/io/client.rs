//! The thread of the connection.
//!
//! What comes waits in a queue of bounded length; when it is full the thread waits, and so, by TCP, does the server. What
//! the client hands over meanwhile waits in a second one, and is counted where that is full too.

use std::path::Path;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use metrology::stamp::{Host, Span, Stamp};
use opcua::client::{Client, ClientBuilder};
use tempfile::TempDir;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

use super::Credentials;
use super::visit::{Held, visit};
use crate::config::{Mode, Settings};
use crate::error::BridgeError;
use crate::stage::{IoCommand, IoEvent};

/// Events that wait for the stage at most; one has the changes of one message.
const QUEUE_LENGTH: usize = 64;
/// Bytes of one message of the server at most.
const MESSAGE_BYTES: usize = 16 << 20;
/// The shortest chunks that a server may send a message in (OPC 10000-6, 6.7.2).
const CHUNK_BYTES: usize = 8192;
/// Elements of an array at most.
const ARRAY_LENGTH: usize = 100_000;
/// A connection that is given up has so long to say goodbye.
const GOODBYE: Duration = Duration::from_secs(1);

/// The host's clock.
#[expect(
    clippy::disallowed_methods,
    reason = "this module stamps what comes from outside"
)]
pub(super) fn host_now() -> Stamp<Host> {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    Stamp::from_nanos(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
}

/// A span as the runtime has it.
pub(super) fn duration(span: Span) -> Duration {
    Duration::from_secs_f64(span.as_secs_f64().max(0.0))
}

/// Where events go.
#[derive(Clone, Debug)]
pub(super) struct Events(mpsc::SyncSender<(Stamp<Host>, IoEvent)>);

impl Events {
    /// Hands an event of `at` over; waits where the queue is full. Whether anybody still listens.
    pub(super) fn send(&self, at: Stamp<Host>, event: IoEvent) -> bool {
        tokio::task::block_in_place(|| self.0.send((at, event)).is_ok())
    }
}

/// The thread that does what the stage wants.
#[derive(Debug)]
pub struct BridgeIo {
    commands: Option<UnboundedSender<IoCommand>>,
    events: Option<mpsc::Receiver<(Stamp<Host>, IoEvent)>>,
    thread: Option<JoinHandle<()>>,
}

impl BridgeIo {
    /// Starts the thread; it does nothing before the first command.
    ///
    /// # Errors
    /// When the certificates cannot be read or made, or the system has no thread left.
    pub fn start(settings: &Settings, credentials: Credentials) -> Result<Self, BridgeError> {
        let failed = |action| move |source| BridgeError::Io { action, source };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("opcua_worker")
            .enable_all()
            .build()
            .map_err(failed("starting the event loop"))?;
        let clients = Clients::new(settings, &credentials)?;
        let (commands, receiver) = unbounded_channel();
        let (sender, events) = mpsc::sync_channel(QUEUE_LENGTH);
        let hands = Hands {
            clients,
            settings: settings.clone(),
            credentials,
            events: Events(sender),
        };
        let thread = std::thread::Builder::new()
            .name("opcua_io".to_owned())
            .spawn(move || {
                let served = runtime.spawn(hands.serve(receiver));
                // A panic in the task has been printed already.
                let _ = runtime.block_on(served);
                runtime.shutdown_timeout(GOODBYE);
            })
            .map_err(failed("starting a thread"))?;
        Ok(Self {
            commands: Some(commands),
            events: Some(events),
            thread: Some(thread),
        })
    }

    /// Hands a wish to the thread.
    pub fn command(&self, command: IoCommand) {
        if let Some(commands) = &self.commands {
            // The receiver lives as long as the thread, and the thread as long as this.
            let _ = commands.send(command);
        }
    }

    /// The next event, when there is one.
    #[must_use]
    pub fn event(&self) -> Option<(Stamp<Host>, IoEvent)> {
        self.events.as_ref()?.try_recv().ok()
    }
}

impl Drop for BridgeIo {
    fn drop(&mut self) {
        self.commands = None;
        // A thread that waits for a place in the queue goes on when there is no queue.
        self.events = None;
        if let Some(thread) = self.thread.take() {
            // A panic in the thread has been printed already.
            let _ = thread.join();
        }
    }
}

/// The clients of a bridge.
pub(super) struct Clients {
    /// Makes sessions, and takes them up again.
    pub session: Client,
    /// Asks a server what it offers, once and without security.
    pub discovery: Client,
    /// Certificates that nobody needs: a client must have a folder.
    _folder: TempDir,
}

impl Clients {
    /// Sets them up; with a secured connection an own certificate is made where there is none.
    pub(super) fn new(settings: &Settings, credentials: &Credentials) -> Result<Self, BridgeError> {
        let folder = tempfile::tempdir().map_err(|source| BridgeError::Io {
            action: "making a folder for certificates",
            source,
        })?;
        let is_secured = settings.security.mode != Mode::None;
        let own = credentials.pki_folder.as_deref().filter(|_| is_secured);
        let session = builder(settings, own.unwrap_or(folder.path()))
            .create_sample_keypair(own.is_some())
            .session_retry_limit(-1);
        let session = built(session)?;
        if let Some(own) = own {
            let store = session.certificate_store().read();
            let read = store.read_own_cert().and(store.read_own_pkey().map(drop));
            read.map_err(|reason| BridgeError::Client {
                action: "reading or making the own certificate",
                reason: format!("{}: {reason}", own.display()),
            })?;
        }
        Ok(Self {
            session,
            discovery: built(builder(settings, folder.path()).session_retry_limit(0))?,
            _folder: folder,
        })
    }
}

fn built(builder: ClientBuilder) -> Result<Client, BridgeError> {
    builder.client().map_err(|reasons| BridgeError::Client {
        action: "setting up the OPC UA client",
        reason: reasons.join("; "),
    })
}

fn builder(settings: &Settings, folder: &Path) -> ClientBuilder {
    let session_ms = settings.session.nanos() / 1_000_000;
    ClientBuilder::new()
        .application_name("Abbe")
        .application_uri("urn:abbe:opcua_bridge")
        .product_uri("urn:abbe")
        .session_name("abbe opcua_bridge")
        .pki_dir(folder)
        .certificate_path("own/cert.der")
        .private_key_path("private/private.pem")
        .trust_server_certs(false)
        .verify_server_certs(true)
        .recreate_subscriptions(false)
        .session_retry_initial(duration(settings.reconnect_first))
        .session_retry_max(duration(settings.reconnect_longest))
        .session_timeout(u32::try_from(session_ms).unwrap_or(u32::MAX))
        .keep_alive_interval(duration(settings.keep_alive))
        .max_failed_keep_alive_count(2)
        .request_timeout(duration(settings.reply_timeout))
        .max_message_size(MESSAGE_BYTES)
        .max_chunk_count(MESSAGE_BYTES / CHUNK_BYTES)
        // A text that cannot be decoded would end the connection. The stage refuses one above 65,536 bytes.
        .max_string_length(MESSAGE_BYTES)
        .max_byte_string_length(MESSAGE_BYTES)
        .max_array_length(ARRAY_LENGTH)
}

/// What the thread holds.
struct Hands {
    clients: Clients,
    settings: Settings,
    credentials: Credentials,
    events: Events,
}

impl Hands {
    /// Does what the stage wants until nobody wants anything any more.
    async fn serve(self, mut commands: UnboundedReceiver<IoCommand>) {
        while let Some(command) = commands.recv().await {
            if command == IoCommand::Disconnect {
                continue;
            }
            let mut held = Held::default();
            let ended = tokio::select! {
                ended = visit(&self.clients, &self.settings, &self.credentials, &self.events, &mut held) => Some(ended),
                _ = commands.recv() => None,
            };
            held.leave(GOODBYE).await;
            let is_heard = ended.is_none_or(|ended| self.events.send(host_now(), ended));
            if !is_heard {
                return;
            }
        }
    }
}
