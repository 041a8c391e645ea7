//! Where alarms are sent: a URL of plain HTTP.

/// Longest URL, bytes.
const MOST_BYTES: usize = 2_000;
/// The port where none is stated.
const USUAL_PORT: u16 = 80;

/// A receiver of alarms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Webhook {
    /// Host and port, as a connection takes them.
    pub address: String,
    /// Host and port as they were given.
    pub host: String,
    /// Path and query, from `/` on.
    pub path: String,
}

impl Webhook {
    /// Reads a URL.
    ///
    /// # Errors
    /// Why no alarm can be sent there, with what to state instead.
    pub fn read(url: &str) -> Result<Self, String> {
        // A password is not repeated.
        let shown = url.rsplit('@').next().unwrap_or(url);
        let begin: String = shown.chars().take(80).collect();
        let wrong = |why: &str| Err(format!("webhook = {begin:?}: {why}"));
        if url.len() > MOST_BYTES {
            return wrong(&format!(
                "has {} bytes: must have at most {MOST_BYTES}",
                url.len()
            ));
        }
        if !url.bytes().all(|byte| byte.is_ascii_graphic()) || url.contains('#') {
            return wrong(
                "must have no blank, no # and ASCII characters only: encode others as %20",
            );
        }
        if url.starts_with("https://") {
            return wrong(
                "https is not spoken: name a relay on this computer that forwards to it, such as http://127.0.0.1:8080/alarm (a reverse proxy, or the receiver's own agent)",
            );
        }
        let Some(rest) = url.strip_prefix("http://") else {
            return wrong("must begin with http://, such as http://127.0.0.1:8080/alarm");
        };
        let begin = rest.find(['/', '?']).unwrap_or(rest.len());
        let (host, path) = rest.split_at(begin);
        if host.contains('@') {
            return wrong("must have no user and password: the receiver would get none");
        }
        let (name, port) = match host.rsplit_once(':') {
            // Colons within brackets are those of an address of IPv6.
            Some((name, port)) if !port.ends_with(']') => (name, Some(port)),
            _ => (host, None),
        };
        if name.is_empty() {
            return wrong("must name a host, such as http://127.0.0.1:8080/alarm");
        }
        let port = match port.map(str::parse::<u16>) {
            None => USUAL_PORT,
            Some(Ok(port)) if port > 0 => port,
            Some(_) => return wrong("its port must be from 1 to 65535"),
        };
        let slash = if path.starts_with('/') { "" } else { "/" };
        Ok(Self {
            address: format!("{name}:{port}"),
            host: host.to_owned(),
            path: format!("{slash}{path}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_url_gives_address_host_and_path() {
        for (url, address, host, path) in [
            ("http://a", "a:80", "a", "/"),
            ("http://a:8080/x?y=1", "a:8080", "a:8080", "/x?y=1"),
            ("http://a?y", "a:80", "a", "/?y"),
            ("http://[::1]/x", "[::1]:80", "[::1]", "/x"),
            ("http://[::1]:9/x", "[::1]:9", "[::1]:9", "/x"),
        ] {
            let read = Webhook::read(url).unwrap();
            let parts = (
                read.address.as_str(),
                read.host.as_str(),
                read.path.as_str(),
            );
            assert_eq!(parts, (address, host, path), "{url}");
        }
    }

    #[test]
    fn a_url_that_nothing_can_be_sent_to_is_refused_with_the_remedy() {
        for (url, words) in [
            ("https://a/x", "relay on this computer"),
            ("ftp://a", "must begin with http://"),
            ("http://", "must name a host"),
            ("http://:80/x", "must name a host"),
            ("http://u:p@a/x", "no user and password"),
            ("http://a:0/", "from 1 to 65535"),
            ("http://a:x/", "from 1 to 65535"),
            ("http://a:65536/", "from 1 to 65535"),
            ("http://a/x y", "no blank"),
            ("http://a/\r\nX: 1", "no blank"),
            ("http://ä/", "ASCII"),
        ] {
            let said = Webhook::read(url).unwrap_err();
            assert!(said.contains(words), "{url}: {said}");
        }
        assert!(
            !Webhook::read("http://u:secret@a/x")
                .unwrap_err()
                .contains("secret")
        );
        let long = format!("http://a/{}", "x".repeat(2_000));
        assert!(Webhook::read(&long).unwrap_err().contains("at most 2000"));
    }
}
