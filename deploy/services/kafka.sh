#!/usr/bin/env bash
# One Apache Kafka broker in KRaft mode on 127.0.0.1, its jars from Maven Central.
#   deploy/services/kafka.sh install | start | stop | status | env
# FLUXGLOBE_KAFKA_PORT (19092): clients; FLUXGLOBE_KAFKA_CONTROLLER_PORT (the next one): the broker's own use.
# FLUXGLOBE_KAFKA_SASL_PORT (none): clients that show a user and a password over TLS. Certificate and password are made at the
# first start with it and lie in the files `certificate.pem` and `password` of the run folder; the user is fluxglobe.
# shellcheck source=process.sh
source "$(dirname "${BASH_SOURCE[0]}")/process.sh"
# shellcheck source=java.sh
source "$here/java.sh"
# shellcheck source=certificate.sh
source "$here/certificate.sh"

port=${FLUXGLOBE_KAFKA_PORT:-19092}
check_port FLUXGLOBE_KAFKA_PORT "$port"
controller_port=${FLUXGLOBE_KAFKA_CONTROLLER_PORT:-$((port + 1))}
check_port FLUXGLOBE_KAFKA_CONTROLLER_PORT "$controller_port"
sasl_port=${FLUXGLOBE_KAFKA_SASL_PORT:-}
if [ -n "$sasl_port" ]; then check_port FLUXGLOBE_KAFKA_SASL_PORT "$sasl_port"; fi
heap=${FLUXGLOBE_KAFKA_HEAP:-320m}

install_service() {
    need_package openssl /usr/bin/openssl
    fetch_jars "$here/kafka/pom.xml"
    say "installed in $service"
}

java_run() {
    local java
    java=$(find_java) || fail 'no Java 17'
    "$@" "$java" "-Xmx$heap" "${small_java[@]}" -Dfluxglobe.log=INFO \
        "-Dlog4j2.configurationFile=$here/kafka/log4j2.xml" -cp "$service/lib/*" "${java_arguments[@]}"
}

# A certificate that is its own authority and a password, each made once.
make_secrets() {
    if ! [ -s "$run/password" ]; then
        (umask 077 && head -c 24 /dev/urandom | base64 | tr '+/' '-_' >"$run/password")
    fi
    if ! [ -s "$run/certificate.pem" ]; then
        make_certificate "$run/key.pem" "$run/certificate.new"
        (umask 077 && cat "$run/key.pem" "$run/certificate.new" >"$run/keystore.pem")
        rm "$run/key.pem"
        mv "$run/certificate.new" "$run/certificate.pem"
    fi
}

secure_settings() {
    cat <<END
ssl.keystore.type=PEM
ssl.keystore.location=$run/keystore.pem
sasl.enabled.mechanisms=PLAIN,SCRAM-SHA-512
listener.name.sasl_ssl.plain.sasl.jaas.config=org.apache.kafka.common.security.plain.PlainLoginModule required user_fluxglobe="$(cat "$run/password")";
listener.name.sasl_ssl.scram-sha-512.sasl.jaas.config=org.apache.kafka.common.security.scram.ScramLoginModule required;
END
}

# One broker: every internal topic has one copy and few partitions, a new group starts without waiting for more members. A
# broker started after kill -9 may not come back before the session of the killed one is over, hence the short one.
write_settings() {
    local secure_listener=''
    rm -f "$run/server.properties"
    if [ -n "$sasl_port" ]; then
        make_secrets
        secure_listener=,SASL_SSL://127.0.0.1:$sasl_port
        (umask 077 && secure_settings >"$run/server.properties")
    fi
    cat >>"$run/server.properties" <<END
process.roles=broker,controller
node.id=1
controller.quorum.voters=1@127.0.0.1:$controller_port
controller.listener.names=CONTROLLER
listener.security.protocol.map=CONTROLLER:PLAINTEXT,PLAINTEXT:PLAINTEXT,SASL_SSL:SASL_SSL
listeners=PLAINTEXT://127.0.0.1:$port,CONTROLLER://127.0.0.1:$controller_port$secure_listener
advertised.listeners=PLAINTEXT://127.0.0.1:$port$secure_listener
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
transaction.abort.timed.out.transaction.cleanup.interval.ms=1000
share.coordinator.state.topic.num.partitions=1
share.coordinator.state.topic.replication.factor=1
share.coordinator.state.topic.min.isr=1
group.initial.rebalance.delay.ms=0
broker.session.timeout.ms=4000
broker.heartbeat.interval.ms=500
log.cleaner.dedupe.buffer.size=16777216
END
}

launch_broker() {
    write_settings
    local java_arguments
    if ! [ -e "$run/data/meta.properties" ]; then
        local cluster_id
        # Letters and digits alone: one that began with a dash would be taken for an option.
        cluster_id=$(head -c 16 /dev/urandom | base64 | tr '+/' 'AB' | tr -d '=')
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

# The user of the SCRAM mechanism is kept by the broker itself; Kafka's own tool adds it, out of a file, since a command line
# is there for everybody to read.
add_scram_user() {
    local password
    password=$(cat "$run/password")
    (umask 077 && printf 'SCRAM-SHA-512=password=%s\n' "$password" >"$run/user.properties")
    # A tool that fails shows what it was given.
    FLUXGLOBE_KAFKA=127.0.0.1:$port "$here/kafka-tool.sh" configs --alter --entity-type users --entity-name fluxglobe \
        --add-config-file "$run/user.properties" 2>&1 | sed "s/$password/(password)/g" >>"$log" ||
        fail "could not add its user; its log: $log"
    rm "$run/user.properties"
    : >"$run/scram_user"
}

start_service() {
    # shellcheck disable=SC2086 # the last one may be absent
    start_once launch_broker broker_answers "$port" "$controller_port" $sasl_port
    if [ -n "$sasl_port" ] && ! [ -e "$run/scram_user" ]; then add_scram_user; fi
}
stop_service() { stop_with TERM; }
status_service() { status_line "127.0.0.1:$port"; }
env_service() {
    printf 'export FLUXGLOBE_KAFKA=127.0.0.1:%s\n' "$port"
    if [ -n "$sasl_port" ]; then
        printf 'export FLUXGLOBE_KAFKA_SASL=127.0.0.1:%s\n' "$sasl_port"
        printf 'export FLUXGLOBE_KAFKA_SASL_PASSWORD_FILE=%q\n' "$run/password"
        printf 'export FLUXGLOBE_KAFKA_SASL_CERTIFICATE=%q\n' "$run/certificate.pem"
    fi
}

main "$@"
