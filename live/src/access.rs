//! Access control of the live view.

use std::net::IpAddr;

/// Who may view a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Access {
    /// Every program of this machine whose request names the loopback interface in the header
    /// `Host`. A web page whose server resolves to 127.0.0.1 (DNS rebinding) sends its own name
    /// there, and is refused. So is a page of another server that a browser names in `Origin`: it
    /// could read a WebSocket otherwise.
    ThisMachine,
    /// Clients with this token: in the header `Authorization: Bearer TOKEN`, or as `?token=TOKEN`
    /// of the address.
    Token(String),
}

/// Parts of a request that determine access.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct AccessRequest<'a> {
    /// Path and query.
    pub(crate) target: &'a str,
    /// The header `Host`.
    pub(crate) host: Option<&'a str>,
    /// The header `Origin`: the page that sends the request, if a browser sends it.
    pub(crate) origin: Option<&'a str>,
    /// The header `Authorization`.
    pub(crate) authorization: Option<&'a str>,
}

impl Access {
    /// Whether a request may be answered.
    pub(crate) fn allows(&self, request: AccessRequest<'_>) -> bool {
        let Self::Token(token) = self else {
            return request.host.is_none_or(is_loopback) && request.origin.is_none_or(is_local);
        };
        let bearer = request.authorization.and_then(|header| header.strip_prefix("Bearer "));
        let query = request.target.split_once('?').map_or("", |(_, query)| query);
        let given = query.split('&').find_map(|pair| pair.strip_prefix("token="));
        bearer.is_some_and(|given| is_same(given, token))
            || given.is_some_and(|given| is_same(given, token))
    }
}

/// Whether `Host` names the loopback interface, with a port or without.
fn is_loopback(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    };
    name.eq_ignore_ascii_case("localhost")
        || name.parse().is_ok_and(|address: IpAddr| address.is_loopback())
}

/// Whether `Origin` names a page of this machine: served by the loopback interface, or a file, as
/// desktop programs built on a browser send.
fn is_local(origin: &str) -> bool {
    let (scheme, host) = origin.split_once("://").unwrap_or_default();
    match scheme {
        "http" | "https" => is_loopback(host),
        "file" => host.is_empty(),
        _ => false,
    }
}

/// Compares in constant time, so that timing reveals nothing about the token.
fn is_same(given: &str, token: &str) -> bool {
    let differ = given.bytes().zip(token.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b));
    given.len() == token.len() && differ == 0
}

#[cfg(test)]
mod tests {
    use super::{Access, AccessRequest};

    #[test]
    fn a_token_opens_by_header_or_address_and_nothing_else_does() {
        let access = Access::Token("secret".to_owned());
        let request = |target, authorization| AccessRequest {
            target,
            origin: Some("https://app.example"),
            authorization,
            ..AccessRequest::default()
        };
        assert!(access.allows(request("/metrics", Some("Bearer secret"))));
        assert!(access.allows(request("/?x=1&token=secret", None)));
        for (target, header) in [
            ("/", None),
            ("/?token=", None),
            ("/?token=secre", None),
            ("/?token=secret2", None),
            ("/", Some("secret")),
            ("/", Some("Bearer Secret")),
        ] {
            assert!(!access.allows(request(target, header)), "{target} {header:?}");
        }
    }

    #[test]
    fn without_a_token_the_address_is_called_by_a_name_of_this_machine() {
        let allows =
            |host| Access::ThisMachine.allows(AccessRequest { host, ..AccessRequest::default() });
        for host in ["127.0.0.1:9177", "localhost:9177", "LOCALHOST", "[::1]:9177", "127.0.0.2"] {
            assert!(allows(Some(host)), "{host}");
        }
        for host in ["evil.example:9177", "127.0.0.1.evil.example", "192.168.0.7:9177", ""] {
            assert!(!allows(Some(host)), "{host}");
        }
        assert!(allows(None), "no browser leaves it out");
    }

    #[test]
    fn without_a_token_no_page_of_another_server_reads_the_cell() {
        let allows = |origin| {
            let host = Some("127.0.0.1:8765");
            let request = AccessRequest { host, origin, ..AccessRequest::default() };
            Access::ThisMachine.allows(request)
        };
        for origin in ["http://localhost:9177", "https://127.0.0.1", "http://[::1]:1", "file://"] {
            assert!(allows(Some(origin)), "{origin}");
        }
        for origin in
            ["https://evil.example", "http://localhost.evil.example", "null", "", "file://x"]
        {
            assert!(!allows(Some(origin)), "{origin}");
        }
        assert!(allows(None), "not sent by a page");
    }
}
