//! Who may look.

/// Who may look at a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Access {
    /// Everybody who reaches the address.
    Everybody,
    /// Who knows this token: in the header `Authorization: Bearer TOKEN`, or as `?token=TOKEN` of the address.
    Token(String),
}

impl Access {
    /// Whether a request with this target and `Authorization` header may be answered.
    pub(crate) fn allows(&self, target: &str, authorization: Option<&str>) -> bool {
        let Self::Token(token) = self else { return true };
        let bearer = authorization.and_then(|header| header.strip_prefix("Bearer "));
        let query = target.split_once('?').map_or("", |(_, query)| query);
        let given = query.split('&').find_map(|pair| pair.strip_prefix("token="));
        bearer.is_some_and(|given| is_same(given, token))
            || given.is_some_and(|given| is_same(given, token))
    }
}

/// Compares in a time that does not tell how much of a guess was right.
fn is_same(given: &str, token: &str) -> bool {
    let differ = given.bytes().zip(token.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b));
    given.len() == token.len() && differ == 0
}

#[cfg(test)]
mod tests {
    use super::Access;

    #[test]
    fn a_token_opens_by_header_or_address_and_nothing_else_does() {
        let access = Access::Token("secret".to_owned());
        assert!(access.allows("/metrics", Some("Bearer secret")));
        assert!(access.allows("/?x=1&token=secret", None));
        for (target, header) in [
            ("/", None),
            ("/?token=", None),
            ("/?token=secre", None),
            ("/?token=secret2", None),
            ("/", Some("secret")),
            ("/", Some("Bearer Secret")),
        ] {
            assert!(!access.allows(target, header), "{target} {header:?}");
        }
        assert!(Access::Everybody.allows("/", None));
    }
}
