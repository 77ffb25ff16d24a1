//! Shards that others wrote (tests/data/attached/v3-sharded.zarr): an index that was tampered with, and chunks that are not in it.

use serde_json::{Value, json};

use crate::attached::{Own, assert_same, expected, request};
use crate::web_server::{Answer, WebServer};

const NAME: &str = "v3-sharded.zarr";
/// Chunks of the one shard: two by two of the map, for each of three steps.
const CHUNKS: [usize; 3] = [2, 2, 3];
/// Place and length of a chunk, and the checksum of all of them, bytes.
const ENTRY_BYTES: usize = 16;
const CRC_BYTES: usize = 4;

/// The checksum of an index, bit by bit (RFC 3720, B.4).
fn crc32c(bytes: &[u8]) -> u32 {
    let step = |sum: u32, byte: &u8| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _bit| {
            (sum >> 1) ^ if sum & 1 == 1 { 0x82F6_3B78 } else { 0 }
        })
    };
    !bytes.iter().fold(!0, step)
}

/// Changes the index of the shard; its checksum follows if that is wanted.
fn change_index(own: &Own, is_checked: bool, change: impl FnOnce(&mut [u8])) {
    let path = own.path().join("sst/c/0/0/0");
    let mut shard = std::fs::read(&path).unwrap();
    let index = CHUNKS.iter().product::<usize>() * ENTRY_BYTES;
    let first = shard.len() - CRC_BYTES - index;
    let (entries, sum) = shard[first..].split_at_mut(index);
    assert_eq!(*sum, crc32c(entries).to_le_bytes());
    change(entries);
    if is_checked {
        sum.copy_from_slice(&crc32c(entries).to_le_bytes());
    }
    std::fs::write(path, shard).unwrap();
}

/// The entry of a chunk by its place.
fn entry(entries: &mut [u8], [row, col, step]: [usize; 3]) -> &mut [u8] {
    let number = (row * CHUNKS[1] + col) * CHUNKS[2] + step;
    &mut entries[number * ENTRY_BYTES..(number + 1) * ENTRY_BYTES]
}

/// Values of the array would be taken for data where a chunk is not there.
fn filled_with_zero(own: &Own) {
    own.edit("sst/zarr.json", |it| it["fill_value"] = json!(0.0));
}

#[tokio::test]
async fn an_index_that_is_not_that_of_its_checksum_is_refused_though_it_names_whole_chunks() {
    let own = Own::with(NAME);
    let swap = |entries: &mut [u8]| {
        let (first, rest) = entries.split_at_mut(ENTRY_BYTES);
        first.swap_with_slice(&mut rest[..ENTRY_BYTES]);
    };
    change_index(&own, false, swap);
    let error = own.attach().await.unwrap_err();
    assert!(error.contains("chunk [0, 0, 0]"), "{error}");
    assert!(error.contains("checksum"), "{error}");
}

#[tokio::test]
async fn an_index_that_leads_beyond_what_can_be_counted_is_damage() {
    let own = Own::with(NAME);
    change_index(&own, true, |entries| {
        let place = [u64::MAX - 5, 10].map(u64::to_le_bytes).concat();
        entries[..ENTRY_BYTES].copy_from_slice(&place);
    });
    let error = own.attach().await.unwrap_err();
    let said = "chunk [0, 0, 0]: is damaged or of another kind";
    assert!(error.contains(said), "{error}");
}

#[tokio::test]
async fn a_chunk_that_a_shard_lacks_is_no_data_or_refused_as_one_that_is_not_there() {
    let take_out = |place| move |entries: &mut [u8]| entry(entries, place).fill(0xFF);
    // No data where the conventions say so: the southern rows of the last step, from Greenwich on.
    let own = Own::with(NAME);
    change_index(&own, true, take_out([0, 0, 2]));
    own.attach().await.unwrap();
    let newest = own.newest().await;
    for (step, mut wanted) in expected(NAME).into_iter().enumerate() {
        if step == 2 {
            for row in 3..6 {
                wanted[row * 8 + 4..row * 8 + 8].fill(f32::NAN);
            }
        }
        let values = own.values(&newest, step).await.unwrap();
        assert_same(&values, &wanted, &format!("step {step}"));
    }
    // Where it would be a value, it is refused, whichever it is.
    for place in [[0, 0, 2], [1, 1, 2], [1, 0, 0]] {
        let own = Own::with(NAME);
        filled_with_zero(&own);
        own.attach().await.unwrap();
        change_index(&own, true, take_out(place));
        let error = own.attach().await.unwrap_err();
        let chunk = format!("chunk {place:?}");
        assert!(
            error.contains(&chunk) && error.contains("fill value 0"),
            "{error}"
        );
    }
}

#[tokio::test]
async fn chunks_that_the_grid_cuts_are_looked_for_too() {
    let cut = |own: &Own| {
        filled_with_zero(own);
        own.edit("sst/zarr.json", |it| it["shape"] = json!([5, 7, 3]));
        own.edit("lat/zarr.json", |it| it["shape"] = json!([5]));
        own.edit("lon/zarr.json", |it| it["shape"] = json!([7]));
    };
    let own = Own::with(NAME);
    cut(&own);
    assert_eq!(own.attach().await.unwrap().steps, 3);
    for place in [[1, 0, 1], [0, 1, 1]] {
        let own = Own::with(NAME);
        cut(&own);
        change_index(&own, true, |entries| entry(entries, place).fill(0xFF));
        let error = own.attach().await.unwrap_err();
        assert!(error.contains(&format!("chunk {place:?}")), "{error}");
    }
}

/// The index of a shard is a part of it, which a server may send all of.
#[tokio::test]
async fn of_a_server_that_knows_no_parts_an_index_is_taken_from_the_whole() {
    let own = Own::with(NAME);
    filled_with_zero(&own);
    let folder = own.path();
    let server = WebServer::start(Box::new(move |path| {
        match std::fs::read(folder.join(path.trim_start_matches("/data/"))) {
            Ok(content) => Answer::Whole("200 OK", vec![], content),
            Err(_) => Answer::Whole("404 Not Found", vec![], vec![]),
        }
    }))
    .await;
    own.ask(&request(&server.url("/data"), "sst"))
        .await
        .unwrap();
    let newest = own.newest().await;
    for (step, wanted) in expected(NAME).iter().enumerate() {
        let values = own.values(&newest, step).await.unwrap();
        assert_same(&values, wanted, &format!("step {step}"));
    }
}

/// A shard of these chunks, each packed; none for one that is not there.
fn shard(chunks: &[Option<Vec<u8>>]) -> Vec<u8> {
    let (mut whole, mut index) = (Vec::<u8>::new(), Vec::<u8>::new());
    for chunk in chunks {
        let entry = chunk.as_ref().map_or([u64::MAX; 2], |chunk| {
            [whole.len() as u64, chunk.len() as u64]
        });
        whole.extend(chunk.iter().flatten());
        index.extend(entry.map(u64::to_le_bytes).concat());
    }
    [whole, index].concat()
}

/// The codec of shards whose chunks have so many values and these codecs.
fn sharded(chunk: u64, codecs: &Value) -> Value {
    let index_codecs = json!([{"name": "bytes", "configuration": {"endian": "little"}}]);
    let configuration = json!({
        "chunk_shape": [chunk],
        "codecs": codecs,
        "index_codecs": index_codecs,
        "index_location": "end",
    });
    json!({"name": "sharding_indexed", "configuration": configuration})
}

/// A store whose three times (the days 0, 1 and 2) are stored so, in a chunk of four.
fn with_times(codecs: &Value, chunk: &[u8]) -> Own {
    let own = Own::with(NAME);
    own.edit("time/zarr.json", |it| {
        it["chunk_grid"]["configuration"]["chunk_shape"] = json!([4]);
        it["codecs"] = codecs.clone();
    });
    std::fs::write(own.path().join("time/c/0"), chunk).unwrap();
    own
}

#[tokio::test]
async fn chunks_are_looked_for_in_shards_of_shards_and_below_other_codecs() {
    let plain = json!([{"name": "bytes", "configuration": {"endian": "little"}}]);
    let time = |day: i32| Some(day.to_le_bytes().to_vec());
    // A time of 0 is the fill value, and a fourth one lies beyond the array.
    let first = |is_there: bool| time(0).filter(|_| is_there);
    let in_shards = |is_there| {
        let halves = [vec![first(is_there), time(1)], vec![time(2), None]];
        shard(&halves.map(|half| Some(shard(&half))))
    };
    let checked = |is_there| {
        let whole = shard(&[first(is_there), time(1), time(2), None]);
        let sum = crc32c(&whole).to_le_bytes();
        [whole, sum.to_vec()].concat()
    };
    let nested = json!([sharded(2, &json!([sharded(1, &plain)]))]);
    let below = json!([sharded(1, &plain), {"name": "crc32c"}]);
    for (codecs, is_there, is_lost) in [
        (nested, in_shards(true), in_shards(false)),
        (below, checked(true), checked(false)),
    ] {
        let own = with_times(&codecs, &is_there);
        own.attach().await.unwrap();
        let newest = own.newest().await;
        for (step, wanted) in expected(NAME).iter().enumerate() {
            let values = own.values(&newest, step).await.unwrap();
            assert_same(&values, wanted, &format!("step {step}"));
        }
        let own = with_times(&codecs, &is_lost);
        let error = own.attach().await.unwrap_err();
        let said = "array time chunk [0]: is not there";
        assert!(error.contains(said), "{codecs}: {error}");
    }
}
