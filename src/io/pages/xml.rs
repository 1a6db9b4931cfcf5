//! Start tags of an XML text with their attributes: all that OME-XML needs.

/// A start tag.
#[derive(Debug, PartialEq)]
pub(super) struct Element<'a> {
    /// Name without its namespace's prefix.
    pub name: &'a str,
    attributes: Vec<(&'a str, String)>,
}

impl Element<'_> {
    /// The value of an attribute, with its references resolved.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(own, _)| *own == name).map(|(_, value)| value.as_str())
    }

    /// An attribute's number.
    pub fn number<T: std::str::FromStr>(&self, name: &str) -> Option<T> {
        self.get(name)?.trim().parse().ok()
    }
}

/// The start tags in the order of the text; comments, declarations and end tags are passed over.
pub(super) fn elements(text: &str) -> impl Iterator<Item = Element<'_>> {
    let mut rest = text;
    std::iter::from_fn(move || {
        loop {
            rest = &rest[rest.find('<')? + 1..];
            if let Some(comment) = rest.strip_prefix("!--") {
                rest = &comment[comment.find("-->")?..];
            } else if !rest.starts_with(['/', '?', '!']) {
                break;
            }
        }
        let end = tag_end(rest)?;
        let tag = rest[..end].trim_end_matches('/');
        rest = &rest[end..];
        let name = &tag[..tag.find(char::is_whitespace).unwrap_or(tag.len())];
        let attributes = attributes(&tag[name.len()..]);
        Some(Element { name: name.rsplit(':').next().unwrap_or(name), attributes })
    })
}

/// Where a tag ends: at the first `>` outside quotes.
fn tag_end(text: &str) -> Option<usize> {
    let mut quote = None;
    text.char_indices().find_map(|(at, c)| {
        match quote {
            None if c == '>' => return Some(at),
            None if matches!(c, '"' | '\'') => quote = Some(c),
            Some(open) if c == open => quote = None,
            _ => {}
        }
        None
    })
}

fn attributes(text: &str) -> Vec<(&str, String)> {
    let mut rest = text;
    let mut found = Vec::new();
    while let Some((name, value)) = rest.split_once('=') {
        let value = value.trim_start();
        let Some(quote) = value.chars().next().filter(|c| matches!(c, '"' | '\'')) else { break };
        let Some((inside, after)) = value[1..].split_once(quote) else { break };
        found.push((name.trim(), resolved(inside)));
        rest = after;
    }
    found
}

/// Text with its character references resolved; unknown ones stay.
fn resolved(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('&') {
        out.push_str(before);
        let reference = after.split_once(';').and_then(|(name, after)| {
            let code = name.strip_prefix('#');
            let c = match (name, code) {
                ("amp", _) => Some('&'),
                ("lt", _) => Some('<'),
                ("gt", _) => Some('>'),
                ("quot", _) => Some('"'),
                ("apos", _) => Some('\''),
                (_, Some(code)) => match code.strip_prefix('x') {
                    Some(digits) => u32::from_str_radix(digits, 16).ok(),
                    None => code.parse().ok(),
                }
                .and_then(char::from_u32),
                _ => None,
            };
            Some((c?, after))
        });
        let (c, after) = reference.unwrap_or(('&', after));
        out.push(c);
        rest = after;
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_have_names_and_attributes() {
        let text = r#"<?xml version="1.0"?><!-- <Pixels SizeC="9"/> --><o:OME x='1'><Pixels SizeC = "2" Unit="&#181;m &lt;&amp;&x;"/></o:OME>"#;
        let found: Vec<_> = elements(text).collect();
        assert_eq!(found.iter().map(|e| e.name).collect::<Vec<_>>(), ["OME", "Pixels"]);
        assert_eq!((found[0].get("x"), found[1].number::<usize>("SizeC")), (Some("1"), Some(2)));
        assert_eq!(found[1].get("Unit"), Some("\u{b5}m <&&x;"));
        for broken in ["<", "<a", "<a b", "<a b=", "<a b=\"", "<a b=c>", "<!--", "&#xffffffff;"] {
            assert!(elements(broken).count() <= 1);
        }
        assert_eq!(resolved("&#xffffffff;&"), "&#xffffffff;&");
    }
}
