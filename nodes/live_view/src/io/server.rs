//! The thread that serves the page.

use std::net::SocketAddr;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONNECTION, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, HeaderValue,
    REFERRER_POLICY, RETRY_AFTER, WWW_AUTHENTICATE, X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use axum::middleware::{self, Next};
use axum::response::Response;
use axum::routing::get;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use metrology::Stage;
use socket2::SockRef;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, oneshot};
use tokio::time::{MissedTickBehavior, interval, sleep};

use super::document::Document;
use super::gate::{Gate, Refusal};
use super::hub::Hub;
use super::{Account, Source};
use crate::config::Settings;
use crate::error::LiveViewError;
use crate::page::ms;
use crate::stage::{Input, LiveViewStage};

/// Connections beside those of event streams.
const SPARE_CONNECTIONS: usize = 32;
/// A request's first line and headers, bytes.
const MOST_HEADER_BYTES: usize = 8 << 10;
const MOST_HEADERS: usize = 64;
/// Send buffer of a connection, bytes.
const MOST_WAITING_BYTES: usize = 64 << 10;
/// Longest time between two events.
const BEAT: Duration = Duration::from_secs(1);
/// Pause after a failed accept.
const AFTER_REFUSAL: Duration = Duration::from_millis(100);

/// State shared by requests.
struct Site {
    document: Document,
    policy: HeaderValue,
    gate: Gate,
    hub: Arc<Hub>,
    places: Arc<Semaphore>,
    most_browsers: usize,
}

/// A running server; it stops when dropped.
pub struct LiveViewIo {
    address: SocketAddr,
    site: Arc<Site>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// Time between two updates.
fn period(settings: &Settings) -> Duration {
    Duration::from_secs_f64(1.0 / settings.config.rate_hz)
}

impl LiveViewIo {
    /// Binds the address and starts serving.
    ///
    /// # Errors
    /// When the address cannot be bound, or the system has no thread left.
    pub fn start(
        settings: &Settings,
        token: Option<String>,
        stage: LiveViewStage,
        source: Source,
    ) -> Result<Self, LiveViewError> {
        let io = |action| move |source| LiveViewError::Io { action, source };
        let address = settings.address;
        let listen = |source| LiveViewError::Listen { address, source };
        let listener = std::net::TcpListener::bind(address).map_err(listen)?;
        let address = listener.local_addr().map_err(listen)?;
        listener.set_nonblocking(true).map_err(listen)?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(io("the server's event queue"))?;
        let site = Arc::new(Site::new(settings, token.as_deref())?);
        let (stop, stopped) = oneshot::channel();
        let (settings, of_thread) = (settings.clone(), Arc::clone(&site));
        let serve = move || {
            runtime.block_on(async {
                // A listening socket in non-blocking mode is always accepted.
                let Ok(listener) = TcpListener::from_std(listener) else {
                    return;
                };
                let looking = look(Arc::clone(&of_thread.hub), period(&settings), stage, source);
                tokio::select! {
                    _ = stopped => {}
                    () = looking => {}
                    () = accept(listener, &settings, of_thread) => {}
                }
            });
        };
        let thread = std::thread::Builder::new()
            .name("live_view".to_owned())
            .spawn(serve)
            .map_err(io("the server's thread"))?;
        Ok(Self {
            address,
            site,
            stop: Some(stop),
            thread: Some(thread),
        })
    }

    /// Address of the page.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Browsers and refused requests so far.
    #[must_use]
    pub fn account(&self) -> Account {
        let site = &self.site;
        Account {
            browsers: site.most_browsers - site.places.available_permits().min(site.most_browsers),
            refused: site.gate.refused(),
        }
    }
}

impl Drop for LiveViewIo {
    fn drop(&mut self) {
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Passes new inputs to the stage and changed parts to the browsers.
async fn look(hub: Arc<Hub>, period: Duration, mut stage: LiveViewStage, mut source: Source) {
    let mut ticks = interval(period);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let (mut inputs, mut silent) = (Vec::new(), Duration::ZERO);
    loop {
        ticks.tick().await;
        let now = source(&mut inputs);
        let mut changed = Vec::new();
        let events = inputs.drain(..).chain([(now, Input::Look)]);
        for (at, input) in events {
            // The error type is Infallible.
            let Ok(()) = stage.step(at, input, &mut changed);
        }
        silent += period;
        let is_beat = silent >= BEAT;
        if is_beat || !changed.is_empty() {
            silent = Duration::ZERO;
        }
        hub.publish(ms(now), changed, is_beat);
    }
}

async fn accept(listener: TcpListener, settings: &Settings, site: Arc<Site>) {
    let connections = site.most_browsers.saturating_add(SPARE_CONNECTIONS);
    let connections = Arc::new(Semaphore::new(connections));
    let mut http = http1::Builder::new();
    http.keep_alive(false)
        .timer(TokioTimer::new())
        .header_read_timeout(Duration::from_secs_f64(settings.config.request_timeout_s))
        .max_buf_size(MOST_HEADER_BYTES)
        .max_headers(MOST_HEADERS);
    let router = router(site);
    let stall = Duration::from_secs_f64(settings.config.stall_timeout_s);
    loop {
        // Further connections wait in the system's backlog.
        let Ok(place) = Arc::clone(&connections).acquire_owned().await else {
            return;
        };
        let Ok((stream, _)) = listener.accept().await else {
            sleep(AFTER_REFUSAL).await;
            continue;
        };
        let (http, router) = (http.clone(), router.clone());
        tokio::spawn(async move {
            let _place = place;
            // A browser may close its connection at any time.
            let _ = http
                .serve_connection(limited(stream, stall), TowerToHyperService::new(router))
                .await;
        });
    }
}

/// A connection that the system ends when the browser reads nothing for `stall`.
fn limited(stream: TcpStream, stall: Duration) -> TokioIo<TcpStream> {
    let socket = SockRef::from(&stream);
    // If the system refuses one of these, a stalled browser is dropped later.
    let _ = socket.set_send_buffer_size(MOST_WAITING_BYTES);
    let _ = socket.set_tcp_user_timeout(Some(stall));
    let _ = socket.set_tcp_nodelay(true);
    TokioIo::new(stream)
}

fn router(site: Arc<Site>) -> Router {
    Router::new()
        .route("/", get(page))
        .route("/snapshot.json", get(snapshot))
        .route("/events", get(events))
        .layer(middleware::from_fn_with_state(Arc::clone(&site), guard))
        .with_state(site)
}

impl Site {
    fn new(settings: &Settings, token: Option<&str>) -> Result<Self, LiveViewError> {
        let document = Document::new();
        let policy =
            HeaderValue::from_str(&document.policy).map_err(|error| LiveViewError::Io {
                action: "the page's policy",
                source: std::io::Error::other(error),
            })?;
        let most_browsers = settings.config.most_browsers as usize;
        Ok(Self {
            document,
            policy,
            gate: Gate::new(token, &settings.host_names),
            hub: Arc::new(Hub::new(period(settings).as_millis())),
            places: Arc::new(Semaphore::new(most_browsers)),
            most_browsers,
        })
    }
}

fn answer(kind: &'static str, body: Body) -> Response {
    let mut response = Response::new(body);
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    response
}

fn refuse(refusal: Refusal) -> Response {
    let mut response = answer("text/plain; charset=utf-8", refusal.sentence().into());
    *response.status_mut() = refusal.status();
    let more: Option<(HeaderName, &str)> = match refusal {
        Refusal::Token => Some((WWW_AUTHENTICATE, "Bearer")),
        Refusal::Full => Some((RETRY_AFTER, "10")),
        _ => None,
    };
    if let Some((name, value)) = more {
        let value = HeaderValue::from_static(value);
        response.headers_mut().insert(name, value);
    }
    response
}

/// Checks each request, and adds the security headers to each answer.
async fn guard(State(site): State<Arc<Site>>, request: Request, next: Next) -> Response {
    let mut response = match site.gate.check(request.uri(), request.headers()) {
        Ok(()) => next.run(request).await,
        Err(refusal) => refuse(refusal),
    };
    let headers = response.headers_mut();
    headers.insert(CONTENT_SECURITY_POLICY, site.policy.clone());
    for (name, value) in [
        (CACHE_CONTROL, "no-store"),
        (CONNECTION, "close"),
        (REFERRER_POLICY, "no-referrer"),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (X_FRAME_OPTIONS, "DENY"),
        (
            HeaderName::from_static("cross-origin-resource-policy"),
            "same-origin",
        ),
        (
            HeaderName::from_static("cross-origin-opener-policy"),
            "same-origin",
        ),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn page(State(site): State<Arc<Site>>) -> Response {
    answer(
        "text/html; charset=utf-8",
        site.document.html.clone().into(),
    )
}

async fn snapshot(State(site): State<Arc<Site>>) -> Response {
    answer("application/json", site.hub.since(None).1.into())
}

async fn events(State(site): State<Arc<Site>>) -> Response {
    let Ok(place) = Arc::clone(&site.places).try_acquire_owned() else {
        site.gate.count(Refusal::Full);
        return refuse(Refusal::Full);
    };
    answer(
        "text/event-stream",
        Body::from_stream(site.hub.events(place)),
    )
}
