#!/usr/bin/env bash
# One Apache Kafka broker in KRaft mode on 127.0.0.1, its jars from Maven Central.
#   deploy/services/kafka.sh install | start | stop | status | env
# FLUXGLOBE_KAFKA_PORT (19092): clients; FLUXGLOBE_KAFKA_CONTROLLER_PORT (the next one): the broker's own use.
# shellcheck source=process.sh
source "$(dirname "${BASH_SOURCE[0]}")/process.sh"
# shellcheck source=java.sh
source "$here/java.sh"

port=${FLUXGLOBE_KAFKA_PORT:-19092}
check_port FLUXGLOBE_KAFKA_PORT "$port"
controller_port=${FLUXGLOBE_KAFKA_CONTROLLER_PORT:-$((port + 1))}
check_port FLUXGLOBE_KAFKA_CONTROLLER_PORT "$controller_port"
heap=${FLUXGLOBE_KAFKA_HEAP:-320m}

install_service() {
    fetch_jars "$here/kafka/pom.xml"
    say "installed in $service"
}

java_run() {
    local java
    java=$(find_java) || fail 'no Java 17'
    # The serial collector: the smallest one, and the others want cores that tests need.
    "$@" "$java" "-Xmx$heap" -XX:+UseSerialGC -XX:+ExitOnOutOfMemoryError -Djava.awt.headless=true \
        -Dfluxglobe.log=INFO "-Dlog4j2.configurationFile=$here/kafka/log4j2.xml" -cp "$service/lib/*" "${java_arguments[@]}"
}

# One broker: every internal topic has one copy and few partitions, a new group starts without waiting for more members.
write_settings() {
    cat >"$run/server.properties" <<END
process.roles=broker,controller
node.id=1
controller.quorum.voters=1@127.0.0.1:$controller_port
controller.listener.names=CONTROLLER
listeners=PLAINTEXT://127.0.0.1:$port,CONTROLLER://127.0.0.1:$controller_port
advertised.listeners=PLAINTEXT://127.0.0.1:$port
log.dirs=$run/data
auto.create.topics.enable=false
num.partitions=4
message.max.bytes=2097152
replica.fetch.max.bytes=2097152
offsets.topic.num.partitions=4
offsets.topic.replication.factor=1
transaction.state.log.num.partitions=4
transaction.state.log.replication.factor=1
transaction.state.log.min.isr=1
share.coordinator.state.topic.num.partitions=1
share.coordinator.state.topic.replication.factor=1
share.coordinator.state.topic.min.isr=1
group.initial.rebalance.delay.ms=0
log.cleaner.dedupe.buffer.size=16777216
END
}

launch_broker() {
    write_settings
    local java_arguments
    if ! [ -e "$run/data/meta.properties" ]; then
        local cluster_id
        cluster_id=$(head -c 16 /dev/urandom | base64 | tr '+/' '-_' | tr -d '=')
        java_arguments=(kafka.tools.StorageTool format --cluster-id "$cluster_id" --config "$run/server.properties")
        java_run env >>"$log" 2>&1 || {
            tail -n 30 "$log" >&2
            fail "could not lay out its data folder; its log: $log"
        }
    fi
    java_arguments=(kafka.Kafka "$run/server.properties")
    java_run launch
}

# Asks in Kafka's own protocol for the list of brokers (Metadata, version 1, no topics) and wants to see one in the answer;
# an open port alone says nothing, the broker answers only when it has joined itself.
broker_answers() {
    local answer
    answer=$(
        exec 3<>"/dev/tcp/127.0.0.1/$port"
        printf '\x00\x00\x00\x0e\x00\x03\x00\x01\x00\x00\x00\x01\xff\xff\x00\x00\x00\x00' >&3
        timeout 2 head -c 12 <&3 | od -An -v -tx1 | tr -d ' \n'
    ) 2>/dev/null
    # Size, the number of our request, the count of brokers.
    [ "${answer:8}" = 0000000100000001 ]
}

start_service() { start_once launch_broker broker_answers "$port" "$controller_port"; }
stop_service() { stop_with TERM; }
status_service() { status_line "127.0.0.1:$port"; }
env_service() { printf 'export FLUXGLOBE_KAFKA=127.0.0.1:%s\n' "$port"; }

main "$@"
