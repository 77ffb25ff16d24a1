//! A data folder of before brought over by `fluxglobe migrate`: budgets, points and tiles are what they were then.

use std::path::Path;

use harness::program;
use serde_json::Value;
use test_data::frozen;

/// A data folder as the first version of this program left it.
fn data() -> tempfile::TempDir {
    let data = tempfile::tempdir().unwrap();
    for part in ["objects", "events"] {
        frozen::copy(1, part, &data.path().join(part));
    }
    data
}

fn of_then(name: &str) -> Value {
    let text = std::fs::read_to_string(frozen::folder(1).join(name)).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Budgets and a place, asked as they were when they were frozen, and a tile.
fn answers(data: &Path) -> (Vec<Value>, Vec<u8>) {
    let ask = |words: &str| {
        let words: Vec<&str> = words.split_whitespace().collect();
        program::json(data, &words).unwrap()
    };
    let told = vec![
        ask("budget --product fgco2 --json --region 1,-50,15,55"),
        ask("budget --product fgco2 --json --region global"),
        ask("stats point --product fgco2 --lon 3.5 --lat 10.5 --json"),
    ];
    let tile = data.join("tile.png");
    let words = "--cpu render tile --layer fgco2 --mode map --z 1 --x 1 --y 0 --time 2001-02-01 -o";
    let words: Vec<&str> = words.split(' ').chain(tile.to_str()).collect();
    program::succeed(data, &words).unwrap();
    (told, std::fs::read(tile).unwrap())
}

#[test]
fn what_is_asked_of_a_store_of_before_is_the_same_after_it_was_brought_over() {
    let data = data();
    let data = data.path();
    let (before, tile_before) = answers(data);
    for (now, name) in before[..2]
        .iter()
        .zip(["budget-box.json", "budget-global.json"])
    {
        let then = of_then(name);
        assert_eq!(now["manifest"], then["manifest"]);
        for what in ["start", "end", "budget_kg", "area_m2"] {
            assert_eq!(
                now["rows"][0][what], then["rows"][0][what],
                "{name}: {what}"
            );
        }
    }
    let point_of_then = of_then("point.json");
    let steps = point_of_then["series"].as_array().unwrap();
    for (at, then) in steps.iter().enumerate() {
        assert_eq!(before[2]["series"][at]["value"], then["value"]);
    }
    assert!(!data.join("objects/cubes").exists(), "it tests nothing");

    let told = program::json(data, &["migrate", "--json"]).unwrap();
    let products = told.as_array().unwrap();
    let names: Vec<_> = products.iter().map(|it| &it["product"]).collect();
    assert_eq!(names, ["fgco2", "fgco2-accumulated"]);
    for product in products {
        assert_eq!(product["refused"], Value::Null);
        let version = &product["versions"][0];
        assert_eq!(
            (&version["put_count"], &version["compared_count"]),
            (&2.into(), &2.into())
        );
    }
    assert!(data.join("objects/cubes/fgco2/repo").is_file());
    program::succeed(data, &["verify"]).unwrap();

    let (after, tile_after) = answers(data);
    assert_eq!(after, before);
    assert!(tile_after == tile_before, "the tile has other bytes");
    // What was stored of fields alone has the same names: nothing is drawn or summed anew for being in a cube.
    let again = program::json(data, &["migrate", "--json"]).unwrap();
    assert_eq!(again[0]["versions"][0]["put_count"], 0);
    let refused = program::fail(data, &["migrate", "--product", "nothing"]).unwrap();
    assert!(refused.contains("there is no product nothing"), "{refused}");
}

#[test]
fn a_field_that_is_damaged_is_named_and_the_other_products_are_brought_over() {
    let data = data();
    let data = data.path();
    let folder = data.join("objects/frames/fgco2");
    let field = std::fs::read_dir(&folder).unwrap().next().unwrap().unwrap();
    let mut content = std::fs::read(field.path()).unwrap();
    let middle = content.len() / 2;
    content[middle] ^= 1;
    std::fs::write(field.path(), content).unwrap();
    let talk = program::fail(data, &["migrate"]).unwrap();
    let name = field.file_name().into_string().unwrap();
    assert!(talk.contains(&name) && talk.contains("1 of them"), "{talk}");
    assert!(data.join("objects/cubes/fgco2-accumulated/repo").is_file());
}
