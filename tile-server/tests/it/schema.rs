//! A value held against a schema of the description, strictly: a field that is not described is a problem too.

use std::collections::BTreeMap;

use serde_json::Value;

/// What is wrong with a value, one line each.
pub(crate) fn problems(description: &Value, schema: &Value, value: &Value) -> Vec<String> {
    let mut found = vec![];
    hold(description, schema, value, "$", &mut found);
    found
}

fn resolved<'a>(description: &'a Value, schema: &'a Value) -> &'a Value {
    match schema["$ref"].as_str() {
        Some(address) => {
            let target = description.pointer(address.trim_start_matches('#'));
            resolved(
                description,
                target.unwrap_or_else(|| panic!("no {address}")),
            )
        }
        None => schema,
    }
}

fn hold(description: &Value, schema: &Value, value: &Value, at: &str, found: &mut Vec<String>) {
    let schema = resolved(description, schema);
    if let Some(choices) = schema["oneOf"].as_array() {
        let fits = |choice: &&Value| problems(description, choice, value).is_empty();
        if choices.iter().filter(fits).count() != 1 {
            found.push(format!("{at}: {value} is not one of {schema}"));
        }
        return;
    }
    if let Some(words) = schema["enum"].as_array()
        && !words.contains(value)
    {
        found.push(format!("{at}: {value} is none of {words:?}"));
    }
    let mut fields = BTreeMap::new();
    let is_object = gather(description, schema, &mut fields);
    if !is_object && !is_of_type(schema, value) {
        found.push(format!("{at}: {value} is not of type {}", schema["type"]));
    } else if is_object {
        match value.as_object() {
            Some(_) if fields.is_empty() => {}
            Some(object) => {
                for name in object
                    .keys()
                    .filter(|name| !fields.contains_key(name.as_str()))
                {
                    found.push(format!("{at}.{name} is not described"));
                }
                for (name, (field, is_required)) in &fields {
                    match object.get(*name) {
                        Some(value) => {
                            hold(description, field, value, &format!("{at}.{name}"), found);
                        }
                        None if *is_required => found.push(format!("{at}.{name} is missing")),
                        None => {}
                    }
                }
            }
            None => found.push(format!("{at}: {value} is no object")),
        }
    }
    if let Some(items) = value.as_array()
        && schema["type"] == "array"
    {
        let first = schema["prefixItems"].as_array();
        let first = first.map_or(&[][..], Vec::as_slice);
        if items.len() < first.len() {
            found.push(format!("{at} is too short"));
        }
        for (i, item) in items.iter().enumerate() {
            match first.get(i).unwrap_or(&schema["items"]) {
                Value::Bool(false) => found.push(format!("{at} is too long")),
                schema => hold(description, schema, item, &format!("{at}[{i}]"), found),
            }
        }
    }
}

/// Fields of an object and whether they must be there, those of its parts included; is it one?
fn gather<'a>(
    description: &'a Value,
    schema: &'a Value,
    fields: &mut BTreeMap<&'a str, (&'a Value, bool)>,
) -> bool {
    let schema = resolved(description, schema);
    let parts = schema["allOf"].as_array();
    for part in parts.into_iter().flatten() {
        gather(description, part, fields);
    }
    let required = schema["required"].as_array();
    let is_required = |name: &str| required.is_some_and(|all| all.iter().any(|one| one == name));
    for (name, field) in schema["properties"].as_object().into_iter().flatten() {
        fields.insert(name, (field, is_required(name)));
    }
    parts.is_some() || schema["type"] == "object"
}

fn is_of_type(schema: &Value, value: &Value) -> bool {
    let is = |name: &Value| match name.as_str() {
        Some("string") => value.is_string(),
        Some("number") => value.is_number(),
        Some("integer") => value.is_u64() || value.is_i64(),
        Some("boolean") => value.is_boolean(),
        Some("array") => value.is_array(),
        Some("null") => value.is_null(),
        Some("object") => value.is_object(),
        _ => panic!("no type: {schema}"),
    };
    match &schema["type"] {
        Value::Array(names) => names.iter().any(is),
        name => is(name),
    }
}
