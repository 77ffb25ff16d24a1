# shellcheck shell=bash
# Java programs from Maven Central: in goes the pom.xml of a service, out comes a folder of jars and a java >= 17.

# shellcheck disable=SC2154 # process.sh sets here and service
# shellcheck source=debian.sh
source "$here/debian.sh"

# A server for tests starts often and shares few cores: the smallest collector, and the compiler that is quick rather than
# thorough (a third less processor time until Kafka and HDFS answer).
# shellcheck disable=SC2034 # used by the files that source this one
small_java=(-XX:+UseSerialGC -XX:TieredStopAtLevel=1 -XX:+ExitOnOutOfMemoryError -Djava.awt.headless=true)

# Prints the path of a Java of version 17 or newer.
find_java() {
    local java
    for java in "${JAVA_HOME:-/nonexistent}/bin/java" "$(command -v java || true)" /usr/lib/jvm/java-17-openjdk-*/bin/java; do
        if [ -x "$java" ] && (($("$java" -version 2>&1 | sed -n 's/.* version "\([0-9]*\).*/\1/p') >= 17)); then
            printf '%s\n' "$java"
            return
        fi
    done
    return 1
}

need_java() {
    find_java >/dev/null || need_package openjdk-17-jre-headless '/usr/lib/jvm/java-17-openjdk-*/bin/java'
    find_java >/dev/null || fail 'no Java 17'
}

# fetch_jars POM: all run-time jars of the pom in $service/lib. Maven checks every archive against its checksum (-C: or fails).
fetch_jars() {
    local pom=$1 wanted
    wanted=$(sha256sum <"$pom")
    if [ "$(cat "$service/installed" 2>/dev/null)" = "$wanted" ]; then return; fi
    need_java
    command -v mvn >/dev/null || need_package maven /usr/bin/mvn
    say "fetching $(sed -n 's:.*<description>\(.*\)</description>.*:\1:p' "$pom") from Maven Central"
    rm -rf "${service:?}/lib" "$service/lib.new"
    mvn --batch-mode --quiet -C --file "$pom" org.apache.maven.plugins:maven-dependency-plugin:3.8.1:copy-dependencies \
        "-DoutputDirectory=$service/lib.new" -DincludeScope=runtime >&2
    mv "$service/lib.new" "$service/lib"
    printf '%s\n' "$wanted" >"$service/installed"
}
