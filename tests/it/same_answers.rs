//! One question has one answer, field by field: on the command line with `--json`, and over HTTP.

use std::path::Path;
use std::time::{Duration, Instant};

use harness::camera::{Came, Camera};
use harness::server::Server;
use harness::{granule, program};
use serde_json::Value;

/// Three months of a flux, what accumulated of it, and a buoy.
fn landed() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path();
    let land = |file: &Path, more: &[&str]| {
        let words = ["ingest", file.to_str().unwrap()];
        program::succeed(data, &[&words[..], more].concat()).unwrap();
    };
    for month in 0..3 {
        land(
            &granule::write(data, month, 0).unwrap(),
            &["--product", "flux"],
        );
    }
    let derive = ["derive", "accumulated", "--product", "flux"];
    program::succeed(data, &derive).unwrap();
    let line = |hour: u32| {
        let wind = f64::from(hour) / 4.0;
        format!("2012 01 01 {hour:02} 50  {wind}   6.1\n")
    };
    let lines: String = (0..24).map(line).collect();
    let buoy = data.join("44005h2012.txt");
    std::fs::write(&buoy, format!("#YY  MM DD hh mm WSPD  ATMP\n{lines}")).unwrap();
    land(&buoy, &[]);
    folder
}

/// Every byte of a text as an address carries it.
fn escaped(text: &str) -> String {
    text.bytes()
        .fold(String::new(), |sofar, byte| sofar + &format!("%{byte:02X}"))
}

/// A line each.
fn lines(data: &Path, words: &str) -> Vec<Value> {
    let words: Vec<&str> = words.split(' ').chain(["--json"]).collect();
    let text = program::succeed(data, &words).unwrap();
    let line = |line: &str| serde_json::from_str(line).unwrap();
    text.lines().map(line).collect()
}

#[test]
fn a_question_on_the_command_line_and_over_http_has_one_answer() {
    let folder = landed();
    let data = folder.path();
    let fifth = "derive --name flux-error --quantity carbon_flux --input f=flux --expr abs(f)*0.2";
    program::succeed(data, &fifth.split(' ').collect::<Vec<_>>()).unwrap();
    let server = Server::start(data, &["serve"]).unwrap();
    let polygon = r#"{"type":"Polygon","coordinates":[[[0.5,0],[40,0],[20,33],[0.5,0]]]}"#;
    let drawn = (
        format!("stats polygon --product flux --region {polygon} --to 2000-03"),
        format!("flux/area?region={}&to=2000-03", escaped(polygon)),
    );
    let questions = [
        ("budget --product flux", "flux/budget"),
        (
            "budget --product flux --region 170,-20,-170.5,33.3 --step month --cells ocean-share --earth local-radius",
            "flux/budget?region=170,-20,-170.5,33.3&step=month&cells=ocean-share&earth=local-radius",
        ),
        (
            "budget --product flux --region 14n-50n --step year --from 1999-02 --to 2000-02-10",
            "flux/budget?region=14n-50n&step=year&from=1999-02&to=2000-02-10",
        ),
        (
            "budget --product flux-accumulated --step month",
            "flux-accumulated/budget?step=month",
        ),
        (drawn.0.as_str(), drawn.1.as_str()),
        (
            "stats polygon --product flux --region china-sea --earth sphere",
            "flux/area?region=china-sea&earth=sphere",
        ),
        (
            "stats point --product flux --lon 181.3 --lat -4.1",
            "flux/point?lon=181.3&lat=-4.1",
        ),
        (
            "stats polygon --product flux --region 170,-20,-170.5,33.3 --statistic mean,sum,std,p90,min --step season --min-coverage 5",
            "flux/area?region=170,-20,-170.5,33.3&statistic=mean,sum,std,p90,min&step=season&min_coverage=5",
        ),
        (
            "stats polygon --product flux --region china-sea --cells ocean-share",
            "flux/area?region=china-sea&cells=ocean-share",
        ),
        (
            "stats line --product flux --line 170,-20;-170.5,33.3;10,80 --statistic mean,max,count --step total --earth sphere",
            "flux/line?line=170,-20;-170.5,33.3;10,80&statistic=mean,max,count&step=total&earth=sphere",
        ),
        (
            "stats point --product flux --lon 181.3 --lat -4.1 --sampling bilinear --step year",
            "flux/point?lon=181.3&lat=-4.1&sampling=bilinear&step=year",
        ),
        (
            "stats point --product flux-accumulated --lon 2 --lat 40",
            "flux-accumulated/point?lon=2&lat=40",
        ),
    ];
    for (words, path) in questions {
        let words: Vec<&str> = words.split_whitespace().chain(["--json"]).collect();
        let printed = program::json(data, &words).unwrap();
        let served = server.get(&format!("/api/products/{path}")).unwrap();
        assert_eq!(served.status, 200, "{path}: {}", served.text());
        let rows = printed.get("rows").or(printed.get("series")).unwrap();
        assert!(!rows.as_array().unwrap().is_empty(), "{printed}");
        assert_eq!(served.json().unwrap(), printed, "{path}");
        with_commas(data, &server, &words[..words.len() - 1], path);
    }
    made_of_series(data, &server);
    besides(data, &server);
}

/// The same with commas.
fn with_commas(data: &Path, server: &Server, words: &[&str], path: &str) {
    let printed = program::succeed(data, &[words, &["--csv"]].concat()).unwrap();
    let more = if path.contains('?') { '&' } else { '?' };
    let path = format!("/api/products/{path}{more}format=csv");
    let served = server.get(&path).unwrap().text();
    assert_eq!(printed.trim_end(), served.trim_end(), "{path}");
}

/// The same of what is asked of a budget besides a region: errors, rivers, parts, versions.
fn besides(data: &Path, server: &Server) {
    let parts = r#"{"type":"FeatureCollection","features":[{"type":"Feature","properties":{"name":"a"},"geometry":{"type":"Polygon","coordinates":[[[0,0],[40,0],[20,33],[0,0]]]}},{"type":"Feature","properties":{"name":"b"},"geometry":{"type":"Polygon","coordinates":[[[30,0],[60,0],[60,33],[30,0]]]}}]}"#;
    let in_parts = (
        format!("--step month --regions {parts} --error 10% --correlation-length-km 500"),
        format!(
            "budget?step=month&regions={}&error=10%25&correlation_length_km=500",
            escaped(parts)
        ),
    );
    for (words, path) in [
        (
            "--region 14n-50n --step month --error 20% --correlation-length-km 700 --correlation-days 45",
            "budget?region=14n-50n&step=month&error=20%25&correlation_length_km=700&correlation_days=45",
        ),
        (
            "--error flux-error --correlation-length-km 0 --cells ocean-share",
            "budget?error=flux-error&correlation_length_km=0&cells=ocean-share",
        ),
        (
            "--region 0,0,60,40 --error 30% --correlation-length-km 3000 --monte-carlo 20 --seed 7",
            "budget?region=0,0,60,40&error=30%25&correlation_length_km=3000&monte_carlo=20&seed=7",
        ),
        (
            "--step year --river-flux 650±300 --river-source somebody",
            "budget?step=year&river_flux=650%C2%B1300&river_source=somebody",
        ),
        ("--river-flux flux", "budget?river_flux=flux"),
        (&in_parts.0, &in_parts.1),
        ("--as-of 2100", "budget?as_of=2100"),
        (
            "--history --region 14n-50n --error 20% --correlation-length-km 700",
            "budget/history?region=14n-50n&error=20%25&correlation_length_km=700",
        ),
    ] {
        let words = ["budget", "--product", "flux"]
            .into_iter()
            .chain(words.split_whitespace());
        let words: Vec<&str> = words.chain(["--json"]).collect();
        let printed = program::json(data, &words).unwrap();
        let served = server.get(&format!("/api/products/flux/{path}")).unwrap();
        assert_eq!(served.status, 200, "{path}: {}", served.text());
        assert_eq!(served.json().unwrap(), printed, "{path}");
    }
    refused_alike(data, server);
}

/// What cannot be asked is refused on both sides, and says why.
fn refused_alike(data: &Path, server: &Server) {
    for (words, path, wanted) in [
        ("--error 20%", "budget?error=20%25", "correlation length"),
        (
            "--error 20% --correlation-length-km -5",
            "budget?error=20%25&correlation_length_km=-5",
            "0 to 1000000 km",
        ),
        (
            "--error flux-accumulated --correlation-length-km 5",
            "budget?error=flux-accumulated&correlation_length_km=5",
            "its unit",
        ),
        (
            "--as-of 1999",
            "budget?as_of=1999",
            "the first version of flux that is kept",
        ),
        ("--as-of yesterday", "budget?as_of=yesterday", "an instant"),
        ("--river-flux 650", "budget?river_flux=650", "river source"),
        (
            "--history --step month",
            "budget/history?step=month",
            "one number",
        ),
        (
            "--history --river-flux 650 --river-source somebody",
            "budget/history?river_flux=650&river_source=somebody",
            "takes no rivers off",
        ),
        (
            "--history --error 1% --correlation-length-km 9 --monte-carlo 20",
            "budget/history?error=1%25&correlation_length_km=9&monte_carlo=20",
            "draws no errors",
        ),
        ("--regions {}", "budget?regions=%7B%7D", "GeoJSON"),
        (
            "--error 1% --correlation-length-km 9 --monte-carlo 99999",
            "budget?error=1%25&correlation_length_km=9&monte_carlo=99999",
            "10 to 10000 draws",
        ),
    ] {
        let words = ["budget", "--product", "flux"]
            .into_iter()
            .chain(words.split_whitespace());
        let words: Vec<&str> = words.collect();
        let refused = program::fail(data, &words).unwrap();
        assert!(refused.contains(wanted), "{words:?}: {refused}");
        let served = server.get(&format!("/api/products/flux/{path}")).unwrap();
        assert_eq!(served.status, 400, "{path}: {}", served.text());
        assert!(served.text().contains(wanted), "{path}: {}", served.text());
    }
}

/// The same of climatologies, correlations, differences and bands.
fn made_of_series(data: &Path, server: &Server) {
    let track = r#"{"type":"LineString","coordinates":[[-40,10],[-10,40]]}"#;
    let drawn = (
        format!(
            "stats line --product flux --line {track} --season --extremes --from 2000-02 --earth sphere"
        ),
        format!(
            "flux/analysis?line={}&parts=season,extremes&from=2000-02&earth=sphere",
            escaped(track)
        ),
    );
    for (words, path) in [
        (
            "stats polygon --product flux --region 14n-50n --climatology --anomaly --trend --extremes",
            "flux/analysis?region=14n-50n&parts=climatology,anomaly,trend,extremes",
        ),
        (
            "stats point --product flux --lon 181.3 --lat -4.1 --climatology --base 2000/2001 --bins season",
            "flux/analysis?lon=181.3&lat=-4.1&parts=climatology&base=2000/2001&bins=season",
        ),
        (
            "stats line --product flux --line 170,-20;-170.5,33.3;10,80 --climatology --anomaly --trend --extremes --min-coverage 20",
            "flux/analysis?line=170,-20;-170.5,33.3;10,80&parts=climatology,anomaly,trend,extremes&min_coverage=20",
        ),
        (&drawn.0, &drawn.1),
        (
            "stats correlate --product flux --product flux-accumulated --line -40,10;-10,40 --max-lag 1",
            "flux/correlation?with=flux-accumulated&line=-40,10;-10,40&max_lag=1",
        ),
        (
            "stats difference --product flux --line -40,10;-10,40 --period 2000/2000 --minus-period 1999/2001",
            "flux/difference?line=-40,10;-10,40&period=2000/2000&minus_period=1999/2001",
        ),
        (
            "stats correlate --product flux --product flux-accumulated --region 14n-50n --max-lag 1",
            "flux/correlation?with=flux-accumulated&region=14n-50n&max_lag=1",
        ),
        (
            "stats difference --product flux --region global --period 2000/2000 --minus-period 1999/2001",
            "flux/difference?region=global&period=2000/2000&minus_period=1999/2001",
        ),
        (
            "stats hovmoller --product flux --along lat --band 20 --region -30,-60,30,60",
            "flux/hovmoller?along=lat&band=20&region=-30,-60,30,60",
        ),
        (
            "stats hovmoller --product flux --along lon --band 20 --region equatorial-pacific --step total --min-coverage 30",
            "flux/hovmoller?along=lon&band=20&region=equatorial-pacific&step=total&min_coverage=30",
        ),
        (
            "stats correlate --product flux --product flux --region 14n-50n --min-coverage 30",
            "flux/correlation?with=flux&region=14n-50n&min_coverage=30",
        ),
        (
            "stats difference --product flux --region global --minus-period 1999/2001 --min-coverage 30",
            "flux/difference?region=global&minus_period=1999/2001&min_coverage=30",
        ),
    ] {
        let words: Vec<&str> = words.split_whitespace().chain(["--json"]).collect();
        let printed = program::json(data, &words).unwrap();
        let served = server.get(&format!("/api/products/{path}")).unwrap();
        assert_eq!(served.status, 200, "{path}: {}", served.text());
        assert_eq!(served.json().unwrap(), printed, "{path}");
    }
    analysed_as_told(data);
}

/// What is analysed along a line is its mean as it is told at every step.
fn analysed_as_told(data: &Path) {
    let line = ["stats", "line", "--product", "flux", "--line"];
    let of = |more: &[&str]| {
        let words = [&line[..], &["-40,10;-10,40;60,-30"], more, &["--json"]].concat();
        program::json(data, &words).unwrap()
    };
    let told = of(&["--statistic", "mean", "--step", "native"]);
    let analysed = of(&["--anomaly"]);
    assert_eq!(analysed["line"], told["geometry"]);
    assert_eq!(
        (&analysed["region"], &analysed["cell"]),
        (&Value::Null, &Value::Null)
    );
    let told = told["rows"].as_array().unwrap();
    let found = analysed["anomaly"]["rows"].as_array().unwrap();
    assert_eq!((told.len(), found.len()), (3, 3));
    for (told, found) in told.iter().zip(found) {
        assert_eq!(
            (&told["start"], &told["end"]),
            (&found["start"], &found["end"])
        );
        assert!(found["value"].is_number(), "{found}");
        assert_eq!(told["values"]["mean"], found["value"]);
    }
    let words = [&line[..], &["0,0;1,1", "--trend", "--statistic", "max"]].concat();
    let refused = program::fail(data, &words).unwrap();
    assert!(refused.contains("leave --statistic"), "{refused}");
}

/// A polygon of so many corners round 20° E, 10° N.
fn round_polygon(corners: u32) -> String {
    let corner = |at: u32| {
        let turn = f64::from(at % corners) / f64::from(corners) * std::f64::consts::TAU;
        format!(
            "[{:.12},{:.12}]",
            20.0 + 15.0 * turn.cos(),
            10.0 + 15.0 * turn.sin()
        )
    };
    let corners: Vec<String> = (0..=corners).map(corner).collect();
    format!(
        r#"{{"type":"Polygon","coordinates":[[{}]]}}"#,
        corners.join(",")
    )
}

#[test]
fn a_geometry_that_is_sent_along_has_the_answer_of_a_file_and_of_an_address() {
    let folder = landed();
    let data = folder.path();
    let server = Server::start(data, &["serve"]).unwrap();
    let track = r#"{"type":"LineString","coordinates":[[-40,10],[-10,40]]}"#;
    let small = round_polygon(20);
    for (path, name, geometry) in [
        ("area?to=2000-03", "region", small.as_str()),
        ("area?statistic=mean,p90&step=total", "region", &small),
        ("line?statistic=mean,max", "line", track),
        ("analysis?parts=climatology,extremes", "region", &small),
        ("analysis?parts=climatology,extremes", "line", track),
        ("correlation?with=flux-accumulated", "line", track),
        (
            "difference?period=2000/2000&minus_period=1999/2001",
            "region",
            &small,
        ),
        ("budget?step=month", "region", &small),
    ] {
        let path = format!("/api/products/flux/{path}");
        let got = server.get(&format!("{path}&{name}={}", escaped(geometry)));
        let (got, sent) = (got.unwrap(), server.post_geojson(&path, geometry).unwrap());
        assert_eq!(sent.status, 200, "{path}: {}", sent.text());
        assert!(sent.body == got.body && sent.etag == got.etag, "{path}");
    }
    // One that no address has room for: the command line reads it from a file, which it is called by.
    let large = round_polygon(100_000);
    let file = data.join("large.geojson");
    std::fs::write(&file, &large).unwrap();
    let file = file.to_str().unwrap();
    let words = [
        "stats",
        "polygon",
        "--product",
        "flux",
        "--json",
        "--region",
        file,
    ];
    let mut printed = program::json(data, &words).unwrap();
    let path = "/api/products/flux/area?to=2000-04";
    let mut served = server.post_geojson(path, &large).unwrap().json().unwrap();
    let name = served["region"].as_str().unwrap().to_owned();
    assert!(name.starts_with("text of ") && name.len() < 120, "{name}");
    for answer in [&mut printed, &mut served] {
        answer["region"] = Value::Null;
    }
    assert_eq!(served, printed);
    // What crosses itself counts once and is told of, and what is no place is refused with the reason of the command line.
    let crossing = r#"{"type":"Polygon","coordinates":[[[0,0],[20,20],[20,0],[0,20],[0,0]]]}"#;
    let served = server.post_geojson(path, crossing).unwrap().json().unwrap();
    assert!(
        served["notes"].to_string().contains("rings cross"),
        "{served}"
    );
    let nowhere = crossing.replace("[20,20]", "[20,91]");
    let words = [
        "stats",
        "polygon",
        "--product",
        "flux",
        "--region",
        &nowhere,
    ];
    let refused = program::fail(data, &words).unwrap();
    let served = server.post_geojson(path, &nowhere).unwrap();
    assert_eq!(served.status, 400, "{}", served.text());
    let reason = served.json().unwrap()["error"].as_str().unwrap().to_owned();
    assert!(refused.contains(&reason), "{refused}: {reason}");
}

#[test]
fn what_there_is_has_one_name_for_each_of_its_parts() {
    let folder = landed();
    let data = folder.path();
    let server = Server::start(data, &["serve"]).unwrap();
    let json = |path: &str| server.get(path).unwrap().json().unwrap();
    let printed = program::json(data, &["products", "--json"]).unwrap();
    let served = json("/api/products");
    let (printed, served) = (printed.as_array(), served["products"].as_array());
    let (printed, served) = (printed.unwrap(), served.unwrap());
    assert_eq!((printed.len(), served.len()), (2, 2));
    for own in printed {
        let same = |other: &&Value| other["product"] == own["product"];
        let other = served.iter().find(same).unwrap();
        for (field, value) in own.as_object().unwrap() {
            assert_eq!(&other[field], value, "{field}");
        }
    }
    let listed = lines(data, "observations list");
    let served = json("/api/observations/platforms");
    let served = served["features"].as_array().unwrap();
    let served: Vec<&Value> = served.iter().map(|one| &one["properties"]).collect();
    assert_eq!(listed.iter().collect::<Vec<_>>(), served);
    let platform = listed[0]["platform"].as_str().unwrap();
    let asked = format!("observations query --dataset ndbc --platform {platform}");
    let measured = lines(data, &asked);
    assert_eq!(measured.len(), 48);
    let served = json(&format!("/api/observations/ndbc/{platform}"));
    assert_eq!(served["observations"], Value::from(measured));
}

#[test]
fn trails_asked_on_the_command_line_and_over_http_are_one_picture() {
    let Some(currents) = test_data::set("currents_globcurrent_agulhas_2002_daily") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path();
    let flux = granule::write(data, 0, 0).unwrap();
    let words = ["ingest", flux.to_str().unwrap(), "--product", "flux"];
    program::succeed(data, &words).unwrap();
    let day = "20020101000000-GLOBCURRENT-L4-CUReul_hs-ALT_SUM-v02.0-fv01.0.nc";
    let day = currents.join(day);
    for profile in ["globcurrent-east", "globcurrent-north"] {
        let words = ["ingest", day.to_str().unwrap(), "--profile", profile];
        program::succeed(data, &words).unwrap();
    }
    let server = Server::start(data, &["serve"]).unwrap();
    for (words, path) in [
        (
            "tile --z 4 --x 9 --y 9 --mode map",
            "tiles/flux/map/4/9/9.png?",
        ),
        (
            "globe --lon 24 --lat -36 --height 2000 --size 256x192 --annotate",
            "globe/flux/volume.png?lon=24&lat=-36&height_km=2000&width=256&height=192&annotate=all&",
        ),
    ] {
        let picture = |more: &str| {
            let file = data.join("picture.png");
            let words = format!("render {words} --layer flux {more} -o {}", file.display());
            let words: Vec<&str> = words.split_whitespace().collect();
            program::succeed(data, &words).unwrap();
            std::fs::read(&file).unwrap()
        };
        let drawn = picture("--trails globcurrent --trails-time 2002-01-01T12:00:00Z");
        let asked = format!("/{path}trails=globcurrent&trails_time=2002-01-01T12:00:00Z");
        let served = server.get(&asked).unwrap();
        assert_eq!(served.status, 200, "{path}: {}", served.text());
        assert!(served.body == drawn, "{path}");
        assert!(picture("") != drawn, "{path}: trails are seen");
    }
}

#[test]
fn a_view_has_the_same_bytes_by_stream_over_http_and_on_the_command_line() {
    let folder = landed();
    let data = folder.path();
    let server = Server::start(data, &["serve"]).unwrap();
    let view = "/globe/flux/map.png?lon=20&lat=10&height_km=6000&width=300&height=200&tilt=20";
    let mut camera = Camera::connect(&server.url).unwrap();
    let id = camera.look(view).unwrap();
    let until = Instant::now() + Duration::from_mins(2);
    let by_stream = loop {
        assert!(Instant::now() < until, "no picture in full");
        match camera.hear().unwrap() {
            Came::Picture(header, bytes) if header["kind"] == "full" => {
                assert_eq!(header["id"], id);
                break bytes;
            }
            Came::Picture(header, _jpeg) => assert_eq!(header["format"], "image/jpeg"),
            Came::Refused(why) => panic!("{why}"),
            Came::Nothing => {}
        }
    };
    let by_http = server.get(view).unwrap();
    assert_eq!(by_http.status, 200);
    assert!(by_stream == by_http.body, "stream and HTTP differ");
    let file = data.join("view.png");
    let words = "render globe --layer flux --mode map --lon 20 --lat 10 --height 6000 --size 300x200 --tilt 20 --background none -o";
    let words: Vec<&str> = words.split(' ').chain(file.to_str()).collect();
    program::succeed(data, &words).unwrap();
    let by_command = std::fs::read(file).unwrap();
    assert!(by_stream == by_command, "stream and command line differ");
}
