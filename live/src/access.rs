//! Access control of the live view.

use std::net::IpAddr;

/// Who may view a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Access {
    /// Every program of this machine whose request names the loopback interface in the header
    /// `Host`. A web page whose server resolves to 127.0.0.1 (DNS rebinding) sends its own name
    /// there, and is refused.
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
    /// The header `Authorization`.
    pub(crate) authorization: Option<&'a str>,
}

impl Access {
    /// Whether a request may be answered.
    pub(crate) fn allows(&self, request: AccessRequest<'_>) -> bool {
        let Self::Token(token) = self else { return request.host.is_none_or(is_loopback) };
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
        let request = |target, authorization| AccessRequest { target, host: None, authorization };
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
}
